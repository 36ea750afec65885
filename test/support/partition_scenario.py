# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
A real network partition: driver and node in two network namespaces, with a link that fails.

Run it in a separate network, with the command that `own_network` returns. It prints the measured
times as one line of JSON.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
import json
import os
from pathlib import Path
import shutil
import time

import children
from fault_bench import fault_bench, FaultBench, STATE_TIMEOUT, STEADY
from joint_state_driver import DriverProcess
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from ros_harness import RosClient, wait_until

OWN_NETWORK = (['unshare', '--net'], ['unshare', '--user', '--map-root-user', '--net'])
"""Commands that run a command in a new network namespace: as root, and as another user."""
NEW_LINK = ['ip', 'link', 'add', 'near', 'type', 'veth', 'peer', 'name', 'far']
SHORT_LEASE = Path(__file__).with_name('short_lease.xml')
"""Participants remove each other 10 s (instead of 20 s) after the last announcement."""


def own_network() -> tuple[list[str], str]:
    """Return the command that runs a command in a separate network, or the reason for none."""
    missing = [name for name in ('unshare', 'nsenter', 'ip') if shutil.which(name) is None]
    if missing:
        return [], f'there is no command {missing[0]!r}'
    for command in OWN_NETWORK:
        tried = children.run(
            [*command, *NEW_LINK], capture_output=True, text=True)
        if tried.returncode == 0:
            return command, ''
    return [], f'network namespaces are not permitted: {tried.stderr.splitlines()[0]}'


def run(*command: str) -> None:
    """Run a command that must succeed."""
    children.run(command, check=True)


def is_running(device: str, prefix: Sequence[str] = ()) -> bool:
    """
    Return whether the link is up, which takes a little longer than setting up both its ends.

    A process that starts earlier never uses the device: Fast DDS searches for running devices only
    once, at its start.
    """
    shown = children.run(
        [*prefix, 'ip', '-json', 'link', 'show', device], check=True, capture_output=True)
    return str(json.loads(shown.stdout)[0]['operstate']) == 'UP'


@contextmanager
def linked_network() -> Iterator[list[str]]:
    """Link this network with another one; yield the command that runs a command in that one."""
    holder = children.popen(['unshare', '--net', 'sleep', 'infinity'])
    over_there = ['nsenter', '--target', str(holder.pid), '--net']
    here = os.readlink('/proc/self/ns/net')
    try:
        wait_until(
            lambda: os.readlink(f'/proc/{holder.pid}/ns/net') != here, 'the other network')
        run(*NEW_LINK, 'netns', str(holder.pid))
        for prefix, device, address in (([], 'near', '10.0.0.1/24'),
                                        (over_there, 'far', '10.0.0.2/24')):
            run(*prefix, 'ip', 'addr', 'add', address, 'dev', device)
            run(*prefix, 'ip', 'link', 'set', 'lo', 'up')
            run(*prefix, 'ip', 'link', 'set', device, 'up')
        wait_until(lambda: is_running('near') and is_running('far', over_there), 'the link')
        yield over_there
    finally:
        holder.kill()
        holder.wait()


def set_again(bench: FaultBench, seconds: float) -> None:
    """Set `state_timeout`; ask again, with a new client, if the failing link loses an answer."""
    name = bench.name('set_parameters')
    request = SetParameters.Request(
        parameters=[Parameter('state_timeout', value=seconds).to_parameter_msg()])
    for _ in range(10):
        try:
            result, = bench.client.call(SetParameters, name, request, 12.0).results
        except AssertionError:
            bench.client.forget(name)
            continue
        assert result.successful, result.reason
        return
    raise AssertionError(f'no answer of {name}')


def break_and_heal(bench: FaultBench, until_forgotten: bool) -> dict[str, float]:
    """Disable the link until commands have ended, or longer; return the measured times [s]."""
    bench.check_alive()
    broken = time.monotonic()
    run('ip', 'link', 'set', 'near', 'down')
    set_again(bench, STATE_TIMEOUT)
    bench.wait_fault('state_timeout')
    reported = time.monotonic()
    set_again(bench, STEADY['state_timeout'])
    bench.wait_silent()
    topic = f'{bench.namespace}/joint_states'
    if until_forgotten:
        wait_until(lambda: not bench.client.node.count_publishers(topic), 'the end of the lease')
    healed = time.monotonic()
    run('ip', 'link', 'set', 'near', 'up')
    bench.wait_running()
    back = time.monotonic()
    bench.check_alive()
    return {'reported': reported - broken, 'broken': healed - broken, 'back': back - healed}


def main() -> None:
    """Run the scenario."""
    os.environ.update(
        ROS_AUTOMATIC_DISCOVERY_RANGE='SUBNET', FASTRTPS_DEFAULT_PROFILES_FILE=str(SHORT_LEASE))
    with linked_network() as over_there, RosClient() as client:
        driver = partial(DriverProcess, prefix=over_there)
        with fault_bench(client, '/faults_partition', driver_type=driver) as bench:
            seen = [break_and_heal(bench, until_forgotten) for until_forgotten in (False, True)]
    print(json.dumps(seen))


if __name__ == '__main__':
    main()
