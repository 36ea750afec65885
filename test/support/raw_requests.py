# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Arbitrary bytes as requests, from a real client over DDS.

rclpy cannot send raw requests, and a topic cannot have the name of a service topic. In this
process, the functions that serialize a UUID serialize the request of a service, as 16 arbitrary
bytes, or those of a TwistWithCovariance, as up to 336 bytes; one of both per service. The type
name, the client and everything else are unchanged.
"""

from collections.abc import Sequence
import ctypes
from importlib import import_module
import sys
from typing import Any

from geometry_msgs.msg import Twist, TwistWithCovariance, Vector3
from lifecycle_msgs.srv import GetState
import numpy as np
from rclpy.type_support import check_is_valid_msg_type, check_is_valid_srv_type
from request_bench import answer_lines, ClientProcess
from ros_harness import RosClient, TIMEOUT
from unique_identifier_msgs.msg import UUID

LENGTH = 16
"""Length of a raw request [bytes]."""
WIDE = 336
"""Length [bytes] of a raw request that is longer than that; zeros are appended to it."""


class RawRequests(ClientProcess):
    """The process that sends raw requests to a node `dynamics`."""

    def __init__(self, namespace: str) -> None:
        super().__init__('raw_requests', namespace)

    def send(self, requests: Sequence[tuple[str, Any, bytes]]) -> None:
        """
        Send requests one after the other.

        A request is the name of a service below `~`, its type, and `LENGTH` or more bytes.
        """
        self.ask([
            (name, kind.__module__, kind.__name__, data.hex())
            for name, kind, data in requests])


class _TypeSupport(ctypes.Structure):
    """The first fields of rosidl_message_type_support_t and of the same type for services."""

    _fields_ = [
        ('identifier', ctypes.c_char_p), ('data', ctypes.c_void_p), ('find', ctypes.c_void_p)]


class _ServiceMembers(ctypes.Structure):
    """service_type_support_callbacks_t of rosidl_typesupport_fastrtps_cpp."""

    _fields_ = [
        ('namespace', ctypes.c_char_p), ('name', ctypes.c_char_p),
        ('request', ctypes.c_void_p), ('response', ctypes.c_void_p)]


class _MessageMembers(ctypes.Structure):
    """message_type_support_callbacks_t of rosidl_typesupport_fastrtps_cpp."""

    _fields_ = [
        ('namespace', ctypes.c_char_p), ('name', ctypes.c_char_p),
        *((name, ctypes.c_void_p) for name in (
            'serialize', 'deserialize', 'size', 'largest_size', 'key'))]


def _for_fast_dds(capsule: Any) -> _TypeSupport:
    """Return the Fast DDS type support of a Python type."""
    api = ctypes.pythonapi
    api.PyCapsule_GetName.restype = ctypes.c_char_p
    api.PyCapsule_GetName.argtypes = [ctypes.py_object]
    api.PyCapsule_GetPointer.restype = ctypes.c_void_p
    api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    address = api.PyCapsule_GetPointer(capsule, api.PyCapsule_GetName(capsule))
    find = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p)(
        _TypeSupport.from_address(address).find)
    return _TypeSupport.from_address(find(address, b'rosidl_typesupport_fastrtps_c'))


def raw_message(data: bytes) -> Any:
    """Return a message whose serialized data are these bytes."""
    if len(data) == LENGTH:
        return UUID(uuid=list(data))
    *twist, covariance = np.split(np.frombuffer(data.ljust(WIDE, b'\0')), (1, 2, 3, 4, 5, 6))
    x, y, z, *angular = (float(one[0]) for one in twist)
    return TwistWithCovariance(covariance=covariance, twist=Twist(
        linear=Vector3(x=x, y=y, z=z), angular=Vector3(**dict(zip('xyz', angular)))))


def raw_type(service_type: Any, message_type: Any) -> Any:
    """Return the service type with another message as request and the original type name."""
    check_is_valid_srv_type(service_type)
    check_is_valid_msg_type(message_type)
    members = _ServiceMembers.from_address(_for_fast_dds(service_type._TYPE_SUPPORT).data)
    request = _MessageMembers.from_address(_TypeSupport.from_address(members.request).data)
    raw = _MessageMembers.from_address(_for_fast_dds(message_type._TYPE_SUPPORT).data)
    for name in ('serialize', 'deserialize', 'size', 'largest_size', 'key'):
        setattr(request, name, getattr(raw, name))
    return type(service_type)('Raw', (), {
        'Request': message_type, 'Response': service_type.Response, 'Event': service_type.Event})


def main() -> None:
    """Send the requests on the standard input."""
    node = f'{sys.argv[1]}/dynamics'
    with RosClient('raw_client') as client:
        services: dict[str, Any] = {}

        def answer(requests: Sequence[tuple[str, str, str, str]]) -> None:
            for name, module, kind, data in requests:
                message = raw_message(bytes.fromhex(data))
                if name not in services:
                    services[name] = client.node.create_client(raw_type(
                        getattr(import_module(module), kind), type(message)), f'{node}/{name}')
                    assert services[name].wait_for_service(TIMEOUT)
                services[name].call_async(message)
                client.call(GetState, f'{node}/get_state')  # answered after that request

        answer_lines(answer)


if __name__ == '__main__':
    main()
