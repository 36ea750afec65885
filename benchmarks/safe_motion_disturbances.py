# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The disturbances of `safe_motion`: each run has at most one, at a random time of its motion.

A disturbance is a function of the scene, whose attributes it changes. All random numbers come from
`Scene.rng`, which depends on the case only.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial
import math

from benchmarks.feed_forward import with_rotors
from benchmarks.safe_motion_cases import (
    arm_named,
    Case,
    duration_of,
    FEED_FORWARD,
    GOAL_MARGIN,
    LONGEST,
    Message,
    motion_of,
    PERIODS,
    PUSH,
    Push,
    push_of,
    RAMP_TIME,
    set_point,
    STREAM_PERIOD,
    trajectory_to,
)
from benchmarks.safe_motion_gearbox import GEARBOX, gearbox, given_friction
from benchmarks.safe_motion_scene import AT_GOAL, Scene
import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.braking import FAULT_DAMPING
from robot_dynamics.control.laws.cartesian_impedance import CartesianImpedance
from robot_dynamics.control.laws.law_table import NO_COMMAND
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.model.payload import make_payload, Payload

GAP, GAP_GOAL = (0.020, 0.048), (0.0, 0.030)
"""[s] between two states, and until the second goal."""
RATE_TIME = (0.1, 0.5)
"""[s] of each rate."""
GOAL_TIME = (0.05, 0.8)
"""[s] between two goals."""
GRAVITY_SHARE = 0.8
"""Largest share of the effort limits that gravity may take."""
ERROR_SHARE = 0.3
"""Largest share of the limit of the following error that an unknown load may take."""
KICK_SHARE = 0.2
"""Largest velocity, by its limit, that a load may cause until the loop reacts."""
NEAR = 0.3
"""[rad] from the poses of a motion in which the sag by a load is computed."""
LOAD = (0.3, 1.0)
"""[kg]"""
LOAD_OFFSET = 0.05
"""Distance of its centre of mass from the last frame [m]."""
ROOM = (0.3, 1.2)
"""[rad] from the start to the limits at which a stream ends."""
BEFORE_LIMIT = (1e-4, 0.05)
"""[rad] from the last set-point of a stream to the limit."""
STREAM_SPEED = (0.2, 0.95)
"""Shares of the velocity limits."""
START_SPEED, START_SHARE = 0.3, 0.3
"""[rad/s], and share of the velocity limit, with which an arm moves when the loop starts."""
LEAST_SCALE = 0.25
"""Scale of the gains that is assumed for a load from the start."""
SAG_TOLERANCE = 1.3
"""Largest sag divided by that for the gravity and the inertia at the goal."""
TRIES = 12


# ---------------------------------------------------------------------- goals


def send_goal(scene: Scene) -> None:
    """Send another goal: back to the start, further or elsewhere, in any form."""
    rng, start, way = scene.rng, scene.motion.start, scene.motion.goal - scene.motion.start
    choices = [start, scene.motion.goal + 0.5 * way]
    choices += [start + rng.uniform(-1.0, 1.0, len(way)) for _ in range(TRIES - 2)]
    if rng.uniform() < 0.4:
        choices = choices[2:]
    elif rng.uniform() < 0.5:
        choices = choices[1:]
    limits = scene.arm.limits
    goal = start
    for choice in choices:
        choice = np.clip(choice, limits.lower + GOAL_MARGIN, limits.upper - GOAL_MARGIN)
        if is_held(scene.plant.arm, scene.plant.q, start, choice):
            goal = choice
            break
    form, in_stream = rng.integers(4), bool(scene.messages)
    scene.messages.clear()
    if form == 0:
        _stream_to(scene, goal, with_velocities=False)
    elif form == 1:
        _stream_to(scene, goal, with_velocities=True)
    elif form == 2:
        duration, trajectory = trajectory_to(scene.arm, scene.state.position, goal)
        scene.quiet_after = scene.time + duration
        if scene.send(trajectory):
            scene.goal = goal
    if form == 3 or scene.goal is not goal:  # a set-point; after a stream, one that is repeated
        point = set_point(scene.arm, goal)
        scene.messages.extend(
            Message(scene.time + i * STREAM_PERIOD, point)
            for i in range(math.ceil((LONGEST - scene.time) / STREAM_PERIOD) if in_stream else 1))
        scene.goal, scene.quiet_after = goal, scene.time


def _stream_to(scene: Scene, goal: FloatArray, with_velocities: bool) -> None:
    """Send set-points along a smooth path from the reference to a goal; repeat the last one."""
    start, arm = scene.state.position, scene.arm
    duration = duration_of(arm, start, goal, 2.0, RAMP_TIME)
    count, total = (math.ceil(time / STREAM_PERIOD) for time in (duration, LONGEST - scene.time))
    points = []
    for s in np.arange(1, count + 1) / count:
        q = start + (s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi)) * (goal - start)
        v = (1.0 - np.cos(2.0 * np.pi * s)) / (count * STREAM_PERIOD) * (goal - start)
        points.append(set_point(arm, q, v if with_velocities else None))
    scene.messages = deque(
        Message(scene.time + i * STREAM_PERIOD, points[min(i, count) - 1])
        for i in range(1, total))
    scene.goal, scene.quiet_after = goal, scene.time + count * STREAM_PERIOD


def is_held(arm: ArmModel, *positions: FloatArray) -> bool:
    """Return whether the drives can hold the arm anywhere in the hull of these positions."""
    body, rng = ArmDynamics(arm).rigid_body, np.random.default_rng(0)
    low, high = np.min(positions, axis=0), np.max(positions, axis=0)
    return all(
        bool((np.abs(body.gravity(q)) <= GRAVITY_SHARE * arm.limits.effort).all())
        for q in (*positions, *rng.uniform(low, high, (3 * TRIES, len(low)))))


# ---------------------------------------------------------------------- disturbances


def gap(scene: Scene) -> None:
    """Send no joint states for 20 to 48 ms, and another goal up to 30 ms later."""
    last = scene.next_state - scene.period
    pause = max(scene.period, round(1e3 * scene.rng.uniform(*GAP)))
    scene.next_state = max(last + pause, scene.next_state)
    scene.later(1e-3 * scene.next_state - scene.time + scene.rng.uniform(*GAP_GOAL),
                lambda: send_goal(scene))


def rate(scene: Scene) -> None:
    """Change the rate of the joint states step by step and back, with a goal in the middle."""
    periods = sorted(PERIODS.values())
    before = scene.period
    steps = [period for period in periods if period > before] or periods[-2::-1]
    time = 0.0
    for period in steps + steps[-2::-1] + [before]:
        scene.later(time, partial(scene.set_period, period))
        time += scene.rng.uniform(*RATE_TIME)
    scene.later(scene.rng.uniform(0.0, time), lambda: send_goal(scene))


def goals(scene: Scene) -> None:
    """Send a second goal and sometimes a third one."""
    send_goal(scene)
    if scene.rng.uniform() < 0.5:
        scene.later(scene.rng.uniform(*GOAL_TIME), lambda: send_goal(scene))


def wrong_velocity(scene: Scene) -> None:
    """
    From now on, measure wrong velocities: one of the wrong sign, zeros, or degrees per second.

    Or the sample of a joint that moves is frozen.
    """
    has_way = np.abs(scene.motion.goal - scene.motion.start) > AT_GOAL
    moving = np.flatnonzero(has_way & (np.abs(scene.plant.v) > AT_GOAL))
    kinds = [*([0, 1, 2] if scene.case.has_velocity else []), *([3] if moving.size else [])]
    if not kinds:
        return
    j = int(scene.rng.choice(moving if moving.size else scene.arm.joint_count))
    kind = int(scene.rng.choice(kinds))
    sample: list[float] = []
    scene.velocities_are_true = False
    if kind == 3:  # the motion ends with a fault
        scene.goal, scene.has_signal[j] = None, False

    def measured(
        q: FloatArray, v: FloatArray | None,
    ) -> tuple[FloatArray, FloatArray | None]:
        q, v = q.copy(), None if v is None else v.copy()
        if kind == 3:
            sample[:] = sample or [q[j], 0.0 if v is None else v[j]]
            q[j] = sample[0]
        if v is not None:
            v[j] = (-v[j], 0.0, v[j], sample[1] if sample else 0.0)[kind]
            v *= (1.0, 0.0, np.degrees(1.0), 1.0)[kind]
        return q, v

    scene.measured = measured


def stop(scene: Scene) -> None:
    """Stop: `~/stop`, the end of the node, or `command: none`."""
    scene.messages.clear()
    scene.goal, loop, kind = None, scene.loop, scene.rng.integers(3)
    before, is_free = scene.state, scene.loop.reference is None
    if kind == 0 or is_free:
        scene.hull.begin(before, scene.limits)
    if kind == 0:
        loop.stop()
    elif kind == 1:
        loop.deactivate(1.0 + scene.time)
    else:
        controller, supervisor = loop.controller, loop.supervisor
        loop.set_options(
            replace(controller.options, command=NO_COMMAND), supervisor.limiter.limits,
            supervisor.options)
    scene.quiet_after = scene.time


def payload(scene: Scene) -> None:
    """Attach a load, which the loop knows or does not know."""
    is_known = scene.rng.uniform() < 0.5
    load = _load(scene, 1.0 if is_known else scene.loop.controller.gains.least, is_known)
    scene.plant.load(scene.arm.with_payloads([load]))
    if is_known:
        scene.loop.controller.set_payloads([load], 0.0, lambda _: None)
    else:
        scene.has_unknown_load = True


def _load(scene: Scene, scale: float, is_known: bool) -> Payload:
    """
    Return a load that the arm can bear, and with which an unaware loop holds the arm.

    Without feedback of the position (hand guiding), an unknown load moves an arm without friction:
    the damping in a fault then bounds its velocity to KICK_SHARE of the velocity limits.
    In the time until the loop reacts, the load accelerates the arm to KICK_SHARE of its velocity
    limits at most. Some descriptions of light wrists have hardly any inertia.
    """
    arm, controller, q = scene.arm, scene.loop.controller, scene.plant.q
    joint = arm.pinocchio_model.getJointId(arm.joint_names[-1])
    link = [name for name in arm.link_names if arm.link_frame(name).parentJoint == joint][-1]
    mass = scene.rng.uniform(*LOAD)
    poses = q, scene.motion.start, scene.motion.goal
    shifts = np.random.default_rng(0).uniform(-NEAR, NEAR, (TRIES, len(q)))
    near = [*poses, *(each + shift for each in poses for shift in shifts)]
    gains, lag = controller.options.gains, 1e-3 * (scene.period + scene.case.delay)
    gain, most = scale**2 * gains.kp, (
        ERROR_SHARE * controller.options.largest_error(arm.limits.velocity))
    if not controller.laws.follows:
        gain, most = scale * FAULT_DAMPING * gains.kd, KICK_SHARE * arm.limits.velocity
    for _ in range(3 * TRIES):
        load = make_payload(link, mass, (0.0, 0.0, LOAD_OFFSET))
        loaded = arm.with_payloads([load])
        sag, kick = (
            factor * np.max(np.abs([
                _acceleration(moved, arm, loaded, each) for each in near]), axis=0)
            for factor, moved in ((1.0 / gain, arm), (lag, loaded)))
        if is_held(loaded, *poses) and (kick <= KICK_SHARE * arm.limits.velocity).all() and (
                is_known or (sag <= most).all()):
            break
        mass *= 0.75
    return load


def _acceleration(
    moved: ArmModel, arm: ArmModel, loaded: ArmModel, q: FloatArray,
) -> FloatArray:
    """Return M⁻¹ Δg, (n,): the change of gravity by a load, on the inertia of the arm `moved`."""
    without, with_load = (ArmDynamics(each).rigid_body.gravity(q) for each in (arm, loaded))
    M = ArmDynamics(moved).rigid_body.mass_matrix(q)
    return np.asarray(np.linalg.solve(M, with_load - without))


def static_sag(scene: Scene) -> FloatArray:
    """
    Return the distance from the goal (n,) that an unknown load causes, with a tolerance.

    It is the static error e of computed torque: M K_p e = Δg, at the position goal − e, that of
    the stiffness K of a Cartesian impedance, K e = Δg, or that of drives with the stiffness k_p,
    at which known dry friction can hold the arm besides. Slow states lower K_p and K.
    """
    e: FloatArray = np.zeros(scene.arm.joint_count)
    drives = scene.drives
    held = e if drives is None else scene.arm.friction.at_rest.static / drives.stiffness
    if not scene.has_unknown_load or scene.goal is None:
        return held
    controller = scene.loop.controller
    kp = controller.gains.least**2 * controller.options.gains.kp
    for _ in range(TRIES):
        q = scene.goal - e
        e = _acceleration(scene.arm, scene.arm, scene.plant.arm, q) / kp
        g, g_0 = (ArmDynamics(arm).rigid_body.gravity(q) for arm in (scene.plant.arm, scene.arm))
        if drives is not None:
            e = (g - g_0) / drives.stiffness
        elif isinstance(controller.laws.with_reference, CartesianImpedance):
            K = controller.laws.with_reference.gains(controller.dynamics, q)[0]
            e = np.asarray(np.linalg.solve(K, g - g_0))
    return SAG_TOLERANCE * np.abs(e) + held


def stream_end(scene: Scene) -> None:
    """Send a stream with velocities towards a position limit; it ends before the limit."""
    limits, rng, q = scene.arm.limits, scene.rng, scene.state.position
    n = len(q)
    upward = rng.uniform(size=n) < 0.5
    bound = np.where(upward, limits.upper, limits.lower)
    if not is_held(scene.arm, q, bound):
        bound = np.where(upward, limits.lower, limits.upper)
    share = np.where(rng.uniform(size=n) < 0.5, 1.0, rng.uniform(0.05, 1.0, n))
    share[rng.integers(n)] = 1.0
    last = q + share * (bound - np.sign(bound - q) * rng.uniform(*BEFORE_LIMIT, n) - q)
    duration = duration_of(
        scene.arm, q, last, 1.0, 3.0 * STREAM_PERIOD, rng.uniform(*STREAM_SPEED))
    count = round(duration / STREAM_PERIOD)
    scene.messages = deque(
        Message(scene.time + i * STREAM_PERIOD, set_point(
            scene.arm, q + i / count * (last - q), (last - q) / (count * STREAM_PERIOD)))
        for i in range(1, count + 1))
    scene.goal, scene.quiet_after = None, scene.time + duration + 0.3


def push(scene: Scene) -> None:
    """Push one joint as in the motion `push`; a guided arm not stronger than its person."""
    pushed = push_of(scene.arm, scene.plant.q, int(scene.rng.integers(8)), scene.case.rate)
    effort = pushed.effort if scene.hand is None else (
        scene.hand.bearable(pushed.effort, scene.plant))
    scene.push = Push(scene.time, scene.time + pushed.end - pushed.begin, effort)


def start(scene: Scene) -> None:
    """Start the loop while the arm moves, or with a load that the loop does not know."""
    rng, n = scene.rng, scene.arm.joint_count
    kind = rng.integers(3)
    if rng.uniform() < 0.5 and scene.case.motion != PUSH:
        scene.messages.clear()
        scene.goal, scene.quiet_after = None, 1.0
    if kind == 2:
        scene.plant.load(scene.arm.with_payloads([_load(scene, LEAST_SCALE, False)]))
        scene.has_unknown_load = True
        return
    speed = START_SPEED if kind == 0 else rng.uniform(0.0, START_SHARE) * scene.arm.limits.velocity
    scene.plant.v = rng.choice([-1.0, 1.0], n) * np.minimum(
        speed, START_SHARE * scene.arm.limits.velocity)
    scene.start_speed = np.abs(scene.plant.v)
    scene.effort = ArmDynamics(scene.arm).rigid_body.gravity(scene.plant.q)


STREAM_END, START = 'stream end', 'start'
DISTURBANCES: dict[str, Callable[[Scene], None]] = {
    'gap': gap, 'rate': rate, 'goals': goals, 'wrong velocity': wrong_velocity, 'stop': stop,
    'payload': payload, STREAM_END: stream_end, 'push': push, START: start, GEARBOX: gearbox}


def scene_of(case: Case) -> Scene:
    """Return the scene of a case with its disturbance."""
    arm, motion = arm_named(case.arm), motion_of(case)
    if case.command == FEED_FORWARD:
        arm = with_rotors(arm)
    if case.disturbance == STREAM_END:  # limits that a stream can reach soon
        motion = motion._replace(push=None)
        rng, q = np.random.default_rng((case.seed, 2)), (motion.start, motion.goal)
        lower, upper = (
            np.min(q, axis=0) - rng.uniform(*ROOM, len(q[0])),
            np.max(q, axis=0) + rng.uniform(*ROOM, len(q[0])))
        arm = replace(arm, limits=replace(
            arm.limits, lower=np.maximum(lower, arm.limits.lower),
            upper=np.minimum(upper, arm.limits.upper)))
    if case.disturbance == GEARBOX:  # from the begin
        scene = Scene(case, given_friction(arm), motion, None)
        gearbox(scene)
        return scene
    return Scene(
        case, arm, motion, DISTURBANCES.get(case.disturbance), case.disturbance == START)
