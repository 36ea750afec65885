# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""SIGINT, SIGTERM and SIGHUP at any time: the last command is safe, and the node exits cleanly."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import threading
import time
from typing import Any

import children
from children import TIMEOUT
from fault_bench import fault_bench, FaultBench, G
from fault_table import fault, fault_cases
from lifecycle_msgs.msg import Transition
import numpy as np
from robot_dynamics_interfaces.srv import InverseDynamicsBatch
from ros_harness import DYNAMICS, NodeProcess, RosClient, running, SIMULATED_ARM, wait_until
from sensor_msgs.msg import JointState

GROUP = 'Shutdown by SIGINT, SIGTERM and SIGHUP'
RAMP, RATE = 0.3, 200.0
"""`ramp_time` [s] and `effort_rate_limit` [N·m/s]; g(q) over the ramp is 165 N·m/s."""
IN_ORDER = 'exit status 0, no traceback'
RAMPED = (
    '`end_action: ramp_to_zero`: the arm is held until it rests; the command ramps to zero over '
    f'`ramp_time` and ends at exactly 0; {IN_ORDER}')
CALLS = 20
"""Number of service calls, which take seconds in total."""


@contextmanager
def commanding(
    client: RosClient, started: Mapping[str, Any] | None = None, **parameters: Any,
) -> Iterator[FaultBench]:
    """Run a commanding node, to which the test sends a signal; `started` is for `NodeProcess`."""
    limits = {
        'ramp_time': RAMP, 'effort_rate_limit': RATE, 'end_action': 'ramp_to_zero', **parameters}
    with fault_bench(client, '/faults_ends', limits, started=started) as bench:
        bench.check_alive()
        yield bench


def check_ended(bench: FaultBench, sent_at: float) -> str:
    """Check that the node exited cleanly after a signal at `sent_at` [s]; return the figures."""
    assert bench.node.wait() == 0, bench.node.log
    assert 'Traceback' not in bench.node.log, bench.node.log
    assert bench.node.log.count(
        'Ending: the arm stops, then the command ends.') == 1, bench.node.log
    bench.wait_silent()
    bench.check_efforts()
    times = np.array([t for t, _ in bench.efforts.published()])
    efforts = np.array([m.effort for _, m in bench.efforts.published()])
    assert not efforts[-1].any()
    assert (np.diff(np.abs(efforts), axis=0) <= 1e-9).all()
    bench.efforts.check_steps(RATE)
    assert times[-1] - sent_at >= RAMP
    ramp = times[np.abs(efforts[:, 0]) < abs(G[0]) - 1e-6]
    return f'{len(ramp)} commands in the ramp to zero, over {1e3 * (ramp[-1] - ramp[0]):.0f} ms'


def signal_node(node: NodeProcess, end_signal: signal.Signals) -> float:
    """Send a signal; return the time [s] of the computer clock."""
    sent_at = time.time()
    os.kill(node.pid, end_signal)
    return sent_at


@fault(GROUP, 'SIGTERM while the node commands, and SIGINT while the command ramps to zero',
       RAMPED)
def test_while_it_commands(client, seen):
    with commanding(client, ramp_time=3.0 * RAMP) as bench:
        sent_at = signal_node(bench.node, signal.SIGTERM)
        bench.efforts.wait_for(lambda m: m.effort[0] > 0.9 * G[0])
        signal_node(bench.node, signal.SIGINT)
        seen(check_ended(bench, sent_at))
        logged, = re.findall(r'\[([\d.]+)\] .*Ending: ', bench.node.log)
        assert float(logged) < bench.efforts.published()[-1][0]  # not after the ramp


@fault(GROUP, 'SIGINT while the node commands and computes service requests',
       f'the ramp does not wait for the service; {RAMPED}')
def test_during_long_service_calls(client, seen):
    service = client.node.create_client(
        InverseDynamicsBatch, '/faults_ends/dynamics/inverse_dynamics_batch')
    try:
        with commanding(client) as bench:
            assert service.wait_for_service(TIMEOUT)
            request = InverseDynamicsBatch.Request(position=np.zeros(200_000))
            answered: list[float] = []
            for _ in range(CALLS):  # seconds of work; the test waits for the first answer
                service.call_async(request).add_done_callback(
                    lambda _: answered.append(time.time()))
            wait_until(lambda: bool(answered), 'the answer of the first call')
            sent_at = signal_node(bench.node, signal.SIGINT)
            check_ended(bench, sent_at)
            ramp = next(t for t, m in bench.efforts.published() if m.effort[0] > G[0] + 1e-6)
            assert len(answered) < CALLS  # the node was still computing
            seen(f'first command of the ramp {1e3 * (ramp - sent_at):.0f} ms after the signal')
    finally:
        client.node.destroy_client(service)


def deactivate(bench: FaultBench) -> None:
    assert bench.change(Transition.TRANSITION_DEACTIVATE)


ENDINGS: dict[str, Callable[[FaultBench], object]] = {
    'SIGINT': lambda bench: signal_node(bench.node, signal.SIGINT),
    'SIGTERM': lambda bench: signal_node(bench.node, signal.SIGTERM),
    'SIGHUP': lambda bench: signal_node(bench.node, signal.SIGHUP),
    'deactivation': deactivate,
    '`command: none`': lambda bench: bench.set_parameters(command='none')}
"""Each begins the end of the command; a signal returns its time."""


@fault_cases(
    'end', GROUP, '{} while the node commands, with `end_action: hold_then_silence` (default)',
    'the arm is held until it rests; the last command holds it; then no command', ENDINGS.items())
def test_the_last_command_holds_the_arm(client, end):
    with commanding(client, end_action='hold_then_silence') as bench:
        states = client.collect(JointState, '/faults_ends/joint_states')
        bench.efforts.clear()
        if end(bench) is None:
            bench.wait_message('command', 'inactive|none .*')
        else:
            assert bench.node.wait() == 0, bench.node.log
        sent = len(bench.efforts.messages)
        states.clear()
        states.wait_count(100)
        states.close()
        assert len(bench.efforts.messages) == sent
        bench.check_hold(1)


ON_A_TERMINAL = (
    'import os, sys; os.setsid(); os.open(sys.argv[1], os.O_RDWR); '
    'os.execvp(sys.argv[2], sys.argv[2:])')
"""Program that runs a command as the leader of a session on a terminal."""


@fault(GROUP, 'the terminal of the node closes while it commands, as an ssh connection that '
       'breaks; `kill -HUP` to a node that was started with `nohup`',
       f'SIGHUP: {RAMPED}; with `nohup` the command continues')
def test_the_terminal_closes(client, seen):
    terminal, of_node = os.openpty()
    started = {'prefix': [sys.executable, '-c', ON_A_TERMINAL, os.ttyname(of_node)]}
    with commanding(client, started) as bench:
        os.close(of_node)
        sent_at = time.time()
        os.close(terminal)
        seen(check_ended(bench, sent_at))
    with commanding(client, {'prefix': ['nohup']}) as bench:
        signal_node(bench.node, signal.SIGHUP)
        bench.check_alive()


# --- nothing to ramp -----------------------------------------------------------------------------

@fault(GROUP, 'SIGINT before the first joint state, SIGTERM before a URDF arrives; SIGINT to '
       '`simulated_arm` in wall time, SIGTERM in lock-step without a controller',
       f'no command; {IN_ORDER}')
def test_without_a_command(client):
    words = 'Ending: no command was active.', 'Ending: the simulation stops.'
    nodes = [NodeProcess(module, parameters, namespace=f'/idle{i}')
             for i, (module, parameters) in enumerate((
                 (DYNAMICS, {}), (DYNAMICS, {'joints': ['elbow']}),
                 (SIMULATED_ARM, {}), (SIMULATED_ARM, {'lock_step': True})))]
    with client.collect(JointState, '/idle0/effort_command') as efforts, running(*nodes):
        efforts.wait_matched()
        for node, end_signal in zip(nodes, 2 * (signal.SIGINT, signal.SIGTERM)):
            signal_node(node, end_signal)
        for i, node in enumerate(nodes):
            assert node.wait() == 0, node.log
            assert 'Traceback' not in node.log, node.log
            assert words[i // 2] in node.log
        assert not efforts.messages


# --- while it starts -----------------------------------------------------------------------------

def started() -> subprocess.Popen[str]:
    """Start what the executable `dynamics_node` runs."""
    code = 'from robot_dynamics.ros.entry_points import dynamics_node as run; exit(run())'
    return children.popen(
        [sys.executable, '-c', code], text=True, env={**os.environ, 'PYTHONUNBUFFERED': '1'},
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)


def wait_for_own_code(process: subprocess.Popen[str]) -> None:
    """Wait until the process has a handler for SIGTERM, which Python does not install."""
    def catches() -> bool:
        status = Path(f'/proc/{process.pid}/status').read_text(encoding='utf-8')
        caught = int(status.split('SigCgt:')[1].split()[0], 16)
        return bool(caught >> (signal.SIGTERM - 1) & 1)

    wait_until(catches, 'a handler of SIGTERM')


def status_after(process: subprocess.Popen[str], end_signal: signal.Signals) -> int:
    """Send a signal; return the exit status, after a check of the output."""
    process.send_signal(end_signal)
    output, _ = process.communicate(timeout=TIMEOUT)
    assert 'Traceback' not in output, output
    return process.returncode


@fault(GROUP, 'SIGINT at several times during the start of the executable `dynamics_node`, from '
       'the first line of its code until it is ready', IN_ORDER)
def test_an_interrupt_while_it_starts():
    whole = started()
    wait_for_own_code(whole)
    began = time.monotonic()
    assert any('Model' in line for line in whole.stdout)
    duration = time.monotonic() - began
    assert status_after(whole, signal.SIGINT) == 0
    for fraction in (0.0, 0.4, 0.8):
        one = started()
        wait_for_own_code(one)
        threading.Event().wait(fraction * duration)  # the stimulus is this time
        assert status_after(one, signal.SIGINT) == 0
