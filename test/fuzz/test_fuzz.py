# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The conversion and validation layer answers or rejects any input, with a clear message.

The short form runs the same examples each time. The long form, `scripts/test -m soak`, draws other
examples each time, from a seed that it prints: `--hypothesis-seed=N` repeats them.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
import secrets
from typing import Any, NamedTuple

from fuzz_arms import ARM, ARMS, CROWD, EVERYTHING_JOINTS, EVERYTHING_URDF, PLANAR_URDF
from fuzz_law import accepts
from fuzz_library import take_joint_state, take_plant, take_states
from fuzz_nodes import PLANAR_JOINTS, RunningNodes, SPEC
import fuzz_strategies as draw
from fuzz_urdf import parameter_messages, urdfs, values
from hypothesis import given, HealthCheck, Phase, seed, settings
from hypothesis import strategies as st
import pytest
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.ros.dynamics.parameters import SPECS
from robot_dynamics.ros.parameters.declared_parameters import ParameterSpec
from robot_dynamics.ros.simulated_arm.node import SPECS as SIMULATED_ARM_SPECS

# A warning of numpy indicates a number that the code did not check.
pytestmark = pytest.mark.filterwarnings('error::RuntimeWarning')

SHORT_EXAMPLES = 40
"""Inputs of each target in the short form."""
LEAST_ACCEPTED, LEAST_REFUSED = 0.05, 0.03
"""
Shares: a test whose inputs all end at the first check, or at none, tests nothing.

Of random joint states, those far from the last place are dropped until five are near each other:
7 % are accepted.
"""
SLOW_MACHINE = (HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example)
Inputs = st.SearchStrategy[tuple[Any, ...]]
Taker = Callable[[RunningNodes], Callable[..., None]]
"""What gives, for the running nodes, the function that takes an input."""


class Target(NamedTuple):
    """Inputs, the code that takes them, and the number of inputs in the long form."""

    name: str
    inputs: Inputs
    taker: Taker
    soak: int


# ---------------------------------------------------------------------------------- inputs

def for_each(
    arms: Sequence[ArmModel], inputs: Callable[[ArmModel], st.SearchStrategy[Any]],
) -> Inputs:
    """Draw the name of an arm, which a failure shows, and an input for this arm."""
    return st.one_of([st.tuples(st.just(arm.name), inputs(arm)) for arm in arms])


def events_of_control(arm: ArmModel) -> st.SearchStrategy[list[Any]]:
    states = draw.joint_states(arm.joint_names)
    return st.lists(st.one_of(
        states, states, draw.trajectories(arm.joint_names), draw.payloads(arm)),
        min_size=1, max_size=5)


def events_of_plant(arm: ArmModel) -> st.SearchStrategy[list[Any]]:
    efforts = draw.efforts(arm.joint_names)
    return st.lists(st.one_of(
        efforts, efforts, draw.wrenches(arm), draw.payloads(arm)), min_size=1, max_size=5)


def start_values(joints: Sequence[str]) -> st.SearchStrategy[dict[str, Any]]:
    """Draw some parameters of a start, for an arm with these joints."""
    names = [spec.name for spec in SPECS
             if spec.name not in ('robot_description', 'robot_description_file', 'joints')]
    some = st.lists(st.sampled_from(names), max_size=4, unique=True).flatmap(
        lambda chosen: st.fixed_dictionaries(
            {name: values(SPEC[name], len(joints)) for name in chosen}))
    order = st.sampled_from(([], list(joints)))
    return st.builds(lambda chosen, given: {**chosen, 'joints': given}, some, order)


# ---------------------------------------------------------------------------------- targets

def in_library(
    name: str, arms: Sequence[ArmModel],
    inputs: Callable[[ArmModel], st.SearchStrategy[Any]],
    take: Callable[[ArmModel, Any], None], soak: int,
) -> Target:
    """Return a target that needs no node."""
    return Target(
        name, for_each(arms, inputs), lambda _: lambda arm, drawn: take(ARM[arm], drawn), soak)


def service(
    name: str, inputs: Callable[[ArmModel], st.SearchStrategy[Any]], soak: int,
    arms: Sequence[ArmModel] = ARMS,
) -> Target:
    """Return a service of `dynamics` as a target."""
    return Target(
        name, for_each(arms, inputs),
        lambda nodes: lambda arm, request: nodes.ask(name, ARM[arm], request), soak)


def topic(name: str, messages: st.SearchStrategy[Any], soak: int) -> Target:
    """Return a topic to which `dynamics` subscribes as a target."""
    return Target(f'topic {name}', st.tuples(st.just(name), messages),
                  lambda nodes: nodes.receive, soak)


def parameters(node: str, specs: Sequence[ParameterSpec], soak: int) -> Target:
    """Return the parameters of a node as a target; half of them can change at run time."""
    changeable = [spec for spec in specs if not spec.read_only]
    often = changeable * (2 * len(specs) // len(changeable))
    some = st.lists(
        parameter_messages((*often, *specs), len(PLANAR_JOINTS)), min_size=1, max_size=2)
    return Target(f'parameters of {node}', st.tuples(st.just(node), some),
                  lambda nodes: nodes.set_parameters, soak)


TARGETS = (
    in_library('joint states', (*ARMS, CROWD), lambda arm: draw.joint_states(arm.joint_names),
               take_joint_state, 24_000),
    in_library('states of a controller', ARMS, events_of_control, take_states, 3_000),
    in_library('efforts of a simulated arm', ARMS, events_of_plant, take_plant, 2_000),
    service('inverse_dynamics', draw.inverse_dynamics, 14_000, (*ARMS, CROWD)),
    service('inverse_dynamics_batch', draw.inverse_dynamics_batch, 9_000, (*ARMS, CROWD)),
    service('inverse_dynamics_trajectory', draw.inverse_dynamics_trajectory, 4_000),
    service('forward_dynamics', draw.forward_dynamics, 8_000),
    service('manipulator_equation', draw.manipulator_equation, 4_000),
    service('task_space', draw.task_space, 4_000),
    service('set_payload', draw.set_payload, 2_000, (*ARMS, CROWD)),
    Target('set_payload of simulated_arm', st.tuples(draw.set_payload(ARMS[0], 0.0)),
           lambda nodes: nodes.ask_simulated_arm, 2_000),
    topic('joint_states', draw.joint_states(PLANAR_JOINTS), 6_000),
    topic('joint_trajectory', draw.trajectories(PLANAR_JOINTS), 4_000),
    parameters('dynamics', SPECS, 2_500),
    parameters('simulated_arm', SIMULATED_ARM_SPECS, 2_000),
    Target('URDFs', st.one_of(
        st.tuples(urdfs((PLANAR_URDF, EVERYTHING_URDF)), st.just({})),
        st.tuples(urdfs((EVERYTHING_URDF,)), st.sampled_from((
            {'joints': ['elbow', 'shoulder']}, {'actuator.torque_constant': [0.1]})))),
        lambda nodes: nodes.start, 2_500),
    Target('parameters of the start', st.tuples(
        st.just(EVERYTHING_URDF), start_values(EVERYTHING_JOINTS)),
        lambda nodes: nodes.start, 1_500),
)


# ---------------------------------------------------------------------------------- tests

@pytest.fixture(scope='module')
def nodes() -> Iterator[RunningNodes]:
    with RunningNodes() as running:
        yield running


def feed(target: Target, nodes: RunningNodes, number: int, count: int) -> None:
    """Draw `count` inputs from a seed; some of them must be accepted, and some rejected."""
    take = target.taker(nodes)
    outcomes: Counter[bool] = Counter()

    @seed(number)
    @settings(
        max_examples=count, derandomize=False, database=None, print_blob=True,
        suppress_health_check=SLOW_MACHINE, phases=(Phase.generate, Phase.shrink))
    @given(target.inputs)
    def law(inputs: tuple[Any, ...]) -> None:
        outcomes[accepts(take, *inputs)] += 1

    law()
    assert outcomes.total() >= count
    assert outcomes[True] >= int(LEAST_ACCEPTED * count), outcomes
    assert outcomes[False] >= int(LEAST_REFUSED * count), outcomes


@pytest.mark.parametrize('target', TARGETS, ids=lambda target: target.name)
def test_any_input_is_answered_or_rejected(target, nodes):
    feed(target, nodes, 0, SHORT_EXAMPLES)


@pytest.mark.soak
@pytest.mark.parametrize('target', TARGETS, ids=lambda target: target.name)
def test_tens_of_thousands_are_answered_or_refused(target, nodes, capsys, pytestconfig):
    given_seed = pytestconfig.getoption('--hypothesis-seed')
    number = secrets.randbits(32) if given_seed is None else int(given_seed)
    with capsys.disabled():
        print(f'\n{target.name}: --hypothesis-seed={number}', end=' ', flush=True)
    feed(target, nodes, number, target.soak)
