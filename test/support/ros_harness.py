# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Real nodes for the tests: processes that run the nodes, and a client that uses them over DDS.

Only the arm is simulated. Every wait is for an event and bounded by `children.TIMEOUT`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, ExitStack
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from typing import Any

from blocked_ends import is_excused
from bounded_waits import Collector, has_stamp, wait_until
from children import LONG as LONG
from children import popen, TIMEOUT
from forked_nodes import ForkedNode, MODULES
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParameters
import rclpy
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String
import yaml

RESEND_PERIOD = 0.5
"""Time after which a message to a best-effort subscription is published again [s]."""
ASK_AGAIN = 20.0
"""Time after which a request is sent again [s]."""
DYNAMICS = 'robot_dynamics.ros.dynamics.node'
SIMULATED_ARM = 'robot_dynamics.ros.simulated_arm.node'
MUJOCO_ARM = 'robot_dynamics_tools.mujoco.mujoco_arm'
MONITOR = 'robot_dynamics_tools.monitor.node'
UNHURRIED = {'state_timeout': 60.0, 'state_max_age': 60.0}
"""Timeouts for a test that publishes joint states itself, not in lock-step, on a busy machine."""
NO_SHARED_MEMORY = {
    'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', 'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}
"""
Environment of a process that a test kills.

With LOCALHOST, rmw_fastrtps uses shared memory, whatever other transports are configured. A
process that is killed while writing there leaves a permanent lock, at which others crash on exit.
"""

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BEST_EFFORT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
KEEP_MANY = QoSProfile(depth=10000)

READY = re.compile(r"Model '|Waiting for a URDF")
"""Log message of the nodes of this package when they are ready."""


def write_parameters(file: Path, parameters: Mapping[str, Any]) -> Path:
    """Write a parameter file for any node; return its path."""
    file.write_text(
        yaml.safe_dump({'/**': {'ros__parameters': dict(parameters)}}), encoding='utf-8')
    return file


class NodeProcess:
    """
    A node, of a package or of this directory, in a separate process; for a `with` statement.

    `parameters` are passed in a file, so that a URDF or an array arrives unchanged. At the end of
    the statement the process gets SIGINT and must exit with status 0 and without a traceback;
    if the test has already failed, its log is printed instead.
    """

    def __init__(
        self, module: str, parameters: Mapping[str, Any] | None = None, *,
        remaps: Mapping[str, str] | None = None, namespace: str = '', node_name: str = '',
        arguments: Sequence[str] = (), environment: Mapping[str, str] | None = None,
        ready: re.Pattern[str] | None = READY, prefix: Sequence[str] = (),
        python: str | Path = sys.executable,
    ) -> None:
        """
        `ready` is a pattern of the log to wait for at the start; None does not wait.

        `python` is the interpreter.
        `prefix` is a command that replaces itself by another one, so that signals reach the node.
        """
        self._directory = tempfile.TemporaryDirectory(prefix='robot_dynamics_test_')
        command = [*prefix, str(python), '-m', module, *arguments, '--ros-args']
        self._is_forked = module in MODULES and not prefix and python == sys.executable and (
            'PYTHONPATH' not in (environment or {}))
        self._module = module
        if parameters:
            file = write_parameters(Path(self._directory.name, 'parameters.yaml'), parameters)
            command += ['--params-file', str(file)]
        rules = dict(remaps or {})
        rules.update({'__ns': namespace} if namespace else {})
        rules.update({'__node': node_name} if node_name else {})
        for name, other in rules.items():
            command += ['-r', f'{name}:={other}']
        self._command = command
        self._environment = {**os.environ, 'PYTHONUNBUFFERED': '1', **(environment or {})}
        self._environment['PYTHONPATH'] = os.pathsep.join(
            [self._environment.get('PYTHONPATH', ''), str(Path(__file__).parent)])
        self._ready = ready
        self._log: list[str] = []
        self._news = threading.Condition()
        self._ended = False

    # ------------------------------------------------------------------ start and end

    def launch(self) -> 'NodeProcess':
        """Start the process; do not wait for it."""
        if self._is_forked:
            self._process = ForkedNode(self._module, self._command[3:], self._environment)
        else:
            self._process = popen(
                self._command, env=self._environment, text=True, errors='replace',
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        self._reader = threading.Thread(target=self._read_log, daemon=True)
        self._reader.start()
        return self

    def start(self) -> 'NodeProcess':
        """Start the process and wait until it is ready; otherwise fail with its log."""
        self.launch()
        if self._ready is not None:
            try:
                self.wait_for_log(self._ready)
            except BaseException:
                self.kill()
                raise
        return self

    def wait(self, timeout: float = TIMEOUT) -> int:
        """Wait until the process exits; return its status, 0 for one that `is_excused`."""
        try:
            status = self._process.wait(timeout)
        except subprocess.TimeoutExpired:
            self.kill()
            raise AssertionError(f'still running after {timeout:g} s:\n{self.log}') from None
        self._reader.join(TIMEOUT)
        self._directory.cleanup()
        return 0 if status == 1 and is_excused(self.log) else status

    def stop(self) -> None:
        """Interrupt the process as Ctrl-C does; it must exit cleanly."""
        self.interrupt()
        status = self.wait()
        assert status == 0, f'exit status {status}:\n{self.log}'
        assert 'Traceback' not in self.log, self.log

    def interrupt(self) -> None:
        """Send SIGINT; do not wait."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)

    def kill(self) -> None:
        """Kill the process."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()
        self._reader.join(TIMEOUT)
        self._directory.cleanup()

    def __enter__(self) -> 'NodeProcess':
        return self.start()

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.stop()
            return
        self.kill()
        print(f'--- log of {" ".join(self._command)}\n{self.log}')

    # ------------------------------------------------------------------ the log

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def log(self) -> str:
        """The output of the process so far."""
        with self._news:
            return ''.join(self._log)

    def wait_for_log(self, pattern: re.Pattern[str] | str, timeout: float = TIMEOUT) -> str:
        """Wait for a line with this pattern; return the line."""
        found: list[str] = []

        def look() -> bool:
            found[:] = [line for line in self._log if re.search(pattern, line)]
            return bool(found) or self._ended

        with self._news:
            in_time = self._news.wait_for(look, timeout)
        assert found, (
            f'{"ended" if in_time else f"{timeout:g} s passed"} without {pattern!r}:\n{self.log}')
        return found[0]

    def provoke(self, send: Callable[[], object], pattern: str, timeout: float = TIMEOUT) -> str:
        """Send until there is a line with this pattern; return the line."""
        deadline = time.monotonic() + timeout
        while not re.search(pattern, self.log) and time.monotonic() < deadline:
            send()  # a subscription may not know its publisher yet
            time.sleep(RESEND_PERIOD)
        return self.wait_for_log(pattern, 1.0)

    def _read_log(self) -> None:
        for line in self._process.stdout:
            with self._news:
                self._log.append(line)
                self._news.notify_all()
        self._process.stdout.close()
        with self._news:
            self._ended = True
            self._news.notify_all()


def log_of_failed_start(
    module: str, parameters: Mapping[str, Any] | None = None, **options: Any,
) -> str:
    """Return the log of a node that cannot start; it must end with status 1, as intended."""
    node = NodeProcess(module, parameters, **options).launch()
    assert node.wait() == 1, node.log
    assert 'Traceback' not in node.log, node.log
    return node.log


@contextmanager
def running(*nodes: NodeProcess) -> Iterator[None]:
    """Run several nodes, which start and stop simultaneously."""
    with ExitStack() as stack:
        for node in nodes:
            stack.push(node.launch())
        for node in nodes:
            node.wait_for_log(READY)
        yield
        for node in nodes:
            node.interrupt()


class RosClient:
    """A node of the tests that spins in a thread, for use in a `with` statement."""

    def __init__(self, name: str = 'test_client', has_parameters: bool = False) -> None:
        self._context = Context()
        rclpy.init(context=self._context)
        self.node = rclpy.create_node(
            name, context=self._context, start_parameter_services=has_parameters)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._clients: dict[str, Any] = {}
        self._closing = False
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        while self._context.ok() and not self._closing:
            try:
                self._executor.spin_once(timeout_sec=0.2)
            except InvalidHandle:  # destroyed by a test in the meantime
                continue

    def close(self) -> None:
        """End the thread and the node."""
        self._closing = True
        self._executor.wake()
        self._thread.join(TIMEOUT)
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)

    def __enter__(self) -> 'RosClient':
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def in_executor(self, call: Callable[[], Any]) -> Any:
        """Return the result of a call in the thread that receives: `ActionClient` has no lock."""
        done, task = threading.Event(), self._executor.create_task(call)
        task.add_done_callback(lambda _: done.set())
        assert done.wait(TIMEOUT), f'the client does not spin for {TIMEOUT:g} s'
        return task.result()

    # ------------------------------------------------------------------ services

    def call(
        self, service_type: Any, name: str, request: Any = None, timeout: float = TIMEOUT,
    ) -> Any:
        """
        Return the response of a service; the default is an empty request.

        It asks again every `ASK_AGAIN`: Fast DDS discards a response if the server has not yet
        discovered the reader of the client (ros2/ros2 issue 1253).
        """
        service = self._clients.get(name)
        if service is None:
            service = self._clients[name] = self.node.create_client(service_type, name)
        assert service.wait_for_service(timeout), f'no service {name} in {timeout:g} s'
        responses: list[Any] = []
        done, deadline = threading.Event(), time.monotonic() + timeout

        def take(future: Any) -> None:
            responses.append(future.result())
            done.set()

        while not done.is_set() and time.monotonic() < deadline:
            service.call_async(
                service_type.Request() if request is None else request).add_done_callback(take)
            done.wait(min(ASK_AGAIN, timeout))
        assert responses, f'no answer of {name} in {timeout:g} s'
        return responses[0]

    def forget(self, prefix: str) -> None:
        """Destroy the clients of services with this prefix, after the end of their server."""
        for name in [name for name in self._clients if name.startswith(prefix)]:
            self.node.destroy_client(self._clients.pop(name))

    def _setting(self, node: str, name: str, value: Any) -> Any:
        """Set a parameter of a node; return the result."""
        parameter = value if isinstance(value, Parameter) else Parameter(name, value=value)
        return self.call(SetParameters, f'{node}/set_parameters', SetParameters.Request(
            parameters=[parameter.to_parameter_msg()])).results[0]

    def set_parameters(self, node: str, values: Mapping[str, Any]) -> list[Any]:
        """Set parameters of a node, one by one; return the results, which must be successes."""
        results = [self._setting(node, name, value) for name, value in values.items()]
        assert all(result.successful for result in results), results
        return results

    def rejection(self, node: str, name: str, value: Any) -> str:
        """Return the reason for which a node rejects a value of a parameter."""
        result = self._setting(node, name, value)
        assert not result.successful, f'{node} accepted {name} {value}'
        return str(result.reason)

    def get_parameter(self, node: str, name: str) -> Any:
        """Return the value of a parameter of a node, None if it is unset."""
        values = self.call(
            GetParameters, f'{node}/get_parameters', GetParameters.Request(names=[name])).values
        return parameter_value_to_python(values[0]) if values else None

    def describe_parameters(self, node: str, names: Sequence[str]) -> dict[str, Any]:
        """Return the descriptors of a node's parameters by name."""
        return {descriptor.name: descriptor for descriptor in self.call(
            DescribeParameters, f'{node}/describe_parameters',
            DescribeParameters.Request(names=list(names))).descriptors}

    def collect(self, message_type: type, topic: str, qos: Any = KEEP_MANY) -> Collector:
        """Record the messages of a topic from now on."""
        return Collector(self.node, message_type, topic, qos)

    @contextmanager
    def describing(self, namespace: str) -> Iterator[Callable[[str], None]]:
        """Yield a function that publishes a URDF on the topic robot_description."""
        topic = self.publisher(String, f'{namespace}/robot_description', LATCHED, subscribers=0)
        yield lambda urdf: topic.publish(String(data=urdf))
        self.node.destroy_publisher(topic)

    def wait_for(
        self, message_type: type, topic: str,
        predicate: Callable[[Any], bool] = lambda _: True,
        timeout: float = TIMEOUT, qos: Any = KEEP_MANY,
    ) -> Any:
        """Return the first message of a topic that fulfils this; fail after the timeout."""
        with self.collect(message_type, topic, qos) as collector:
            return collector.wait_for(predicate, timeout)

    def publisher(
        self, message_type: type, topic: str, qos: Any = 10, subscribers: int = 1,
        timeout: float = TIMEOUT,
    ) -> Any:
        """Return a publisher with this number of matched subscribers."""
        publisher = self.node.create_publisher(message_type, topic, qos)
        wait_until(
            lambda: publisher.get_subscription_count() >= subscribers,
            f'{subscribers} subscribers of {topic}', timeout)
        return publisher

    def ask(
        self, publisher: Any, message: Any, answers: Collector,
        predicate: Callable[[Any], bool], timeout: float = TIMEOUT,
    ) -> Any:
        """Publish until an answer fulfils the predicate; return that answer."""
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            publisher.publish(message)
            found = answers.find(predicate, RESEND_PERIOD)
            if found is not None:
                return found
        raise AssertionError(f'no answer in {timeout:g} s to {message}; {answers.matching()}')

    def answer_to(self, publisher: Any, message: Any, answers: Collector) -> Any:
        """Publish until there is an answer with the stamp of this message; return it."""
        return self.ask(publisher, message, answers, has_stamp(message.header.stamp))
