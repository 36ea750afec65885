# Shared by the scripts of this directory; not a command.
# shellcheck shell=bash

root=${root:?}
venv_parent=$root
venv=$venv_parent/.venv
ros_prefix=${ROS_PREFIX:-/opt/ros/jazzy}

has_ros() { [ -e "$ros_prefix/setup.bash" ]; }

say() { printf '\033[2m== %s\033[0m\n' "$*" >&2; }

# fail MESSAGE [LOG] [STATUS]: one clear line; the log of what went wrong is kept and named.
fail() {
  local details=''
  if [ -s "${2:-}" ]; then
    mkdir -p "$root/log"
    cp "$2" "$root/log/setup.txt"
    details=" (What it said: log/setup.txt.)"
  fi
  printf 'robot_dynamics: %s%s\n' "$1" "$details" >&2
  exit "${3:-1}"
}

# The environment of ROS, without this workspace.
enter_ros() {
  if has_ros; then
    set +u  # setup.bash of ROS reads variables that may not be set
    # shellcheck source=/dev/null
    source "$ros_prefix/setup.bash"
    set -u
  else
    export AMENT_PREFIX_PATH=$venv CMAKE_PREFIX_PATH=$venv ROS_DISTRO=jazzy ROS_VERSION=2
  fi
  export PATH=$venv/bin:$PATH VIRTUAL_ENV=$venv
}

# The environment of ROS, with this workspace.
enter_workspace() {
  enter_ros
  set +u
  # shellcheck source=/dev/null
  source "$root/install/local_setup.bash"
  set -u
}
