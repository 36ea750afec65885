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

# groups_of WORD…: the groups of libraries that only some commands need, for the command of these words.
groups_of() {
  local word option='' found=''
  for word in "$@"; do
    case "$option$word" in
      analyze | animate | calibrate_gravity | dynamics_monitor | estimate_payload | identify | learn_contact_levels | --replay*) found+=' analysis' ;;
      viewer | --viewer*) found+=' viewer' ;;
      --robot*[./]* | --urdf*[./]*) ;;  # a file or a package
      --robot[=\ ]?* | --urdf[=\ ]?*) found+=' robots' ;;  # a name, such as ur10
    esac
    option=''
    case "$word" in --robot | --urdf) option="$word " ;; esac
  done
  echo "$found"
}

# The environment of ROS, without this workspace.
enter_ros() {
  # Python keeps what it compiles: a node of uncompiled modules takes twice as long to start. Many containers forbid it.
  unset PYTHONDONTWRITEBYTECODE
  if has_ros; then
    set +u  # setup.bash of ROS reads variables that may not be set
    # shellcheck source=/dev/null
    source "$ros_prefix/setup.bash"
    set -u
  else
    export AMENT_PREFIX_PATH=$venv CMAKE_PREFIX_PATH=$venv ROS_DISTRO=jazzy ROS_VERSION=2 CMAKE_GENERATOR=Ninja
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
