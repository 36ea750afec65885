# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Many recordings: processes, cached results, failures, and a Dask cluster."""

import os
from pathlib import Path
import pickle
import sys

import numpy as np
import pytest
from robot_dynamics.exceptions import MissingDependencyError, RobotDynamicsError
from robot_dynamics.model_check.html_page import Origin
from robot_dynamics_tools.analysis.arm_recording import AnalysisSettings
from robot_dynamics_tools.analysis.batch import load_result, run_tasks, save_result, task_key
from robot_dynamics_tools.analysis.tasks import AnalysisTask
import tasks


@pytest.fixture
def bags(tmp_path):
    """Return a function that writes files with these texts, and a configuration for the log."""
    def write(*texts):
        paths = [tmp_path / f'b{i}.db3' for i in range(len(texts))]
        for path, text in zip(paths, texts):
            path.write_text(text)
        return paths

    return write


@pytest.fixture
def configuration(tmp_path):
    return {'factor': 2.0, 'log': str(tmp_path / 'log')}


def test_results_come_in_order_and_failures_are_listed(bags, configuration):
    reported = []
    outcomes = run_tasks(
        tasks.measure, bags('one', 'refuse', 'three', 'fail'), configuration, workers=1,
        on_done=reported.append)
    assert [outcome.error for outcome in outcomes] == [
        '', 'this one cannot be read', '', 'ZeroDivisionError: an accident']
    assert [outcome.result and outcome.result['size'] for outcome in outcomes] == [
        3, None, 5, None]
    assert reported == outcomes


def test_a_process_that_dies_loses_only_its_own_task(bags, configuration):
    outcomes = run_tasks(
        tasks.measure, bags('one', 'die', 'three', 'refuse'), configuration, workers=2)
    assert [bool(outcome.error) for outcome in outcomes] == [False, True, False, True]
    assert 'its process died' in outcomes[1].error
    for outcome in (outcomes[0], outcomes[2]):
        assert outcome.result['process'] != os.getpid()
        assert outcome.result['one_thread'] == '1'
        np.testing.assert_array_equal(outcome.result['factor'], [0.0, 2.0, 4.0])


def test_a_cached_result_is_used_unless_an_input_changed(bags, configuration, tmp_path):
    paths, cache = bags('one', 'two', 'refuse'), tmp_path / 'kept'

    def run(**changes):
        outcomes = run_tasks(
            tasks.measure, paths, {**configuration, **changes}, workers=1, cache=cache)
        return [outcome.resumed for outcome in outcomes], outcomes

    assert run()[0] == [False, False, False]
    assert sorted(Path(configuration['log']).read_text().split()) == [
        'b0.db3', 'b1.db3', 'b2.db3']
    resumed, outcomes = run()
    assert resumed == [True, True, False]  # a failure is repeated
    np.testing.assert_array_equal(outcomes[0].result['factor'], [0.0, 2.0, 4.0])
    assert outcomes[0].result['size'] == 3
    paths[1].write_text('too')
    assert run()[0] == [True, False, False]
    assert run(factor=3.0)[0] == [False, False, False]
    assert run()[0] == [True, True, False]


def test_a_kept_dataclass_is_the_same_again(bags, tmp_path):
    paths = bags('one', 'two')

    def run(values):
        return run_tasks(tasks.scale, paths, tasks.Factor(np.array(values)), 1, tmp_path / 'kept')

    assert [outcome.resumed for outcome in run([1.5, np.nan])] == [False, False]
    for outcome in run([1.5, np.nan]):
        assert outcome.resumed
        kept = outcome.result
        assert isinstance(kept, tasks.Scaled)
        assert (kept.sizes, kept.span, kept.missing) == ((3, 3), (outcome.bag.name, np.inf), None)
        for factor in (kept.factor, kept.by_name['a'], kept.present):
            assert isinstance(factor, tasks.Factor)
            np.testing.assert_array_equal(factor.values, [1.5, np.nan])
    assert [outcome.resumed for outcome in run([1.5, 2.0])] == [False, False]


def test_a_kept_result_that_does_not_hold_is_done_again(bags, configuration, tmp_path):
    paths = bags('one', 'three')
    for expected in ([False, False], [False, True]):
        outcomes = run_tasks(
            tasks.measure, paths, configuration, 1, tmp_path / 'kept', is_valid=tasks.is_large)
        assert [outcome.resumed for outcome in outcomes] == expected


def test_an_interrupted_run_is_resumed(bags, configuration, tmp_path):
    def interrupt(_):
        raise KeyboardInterrupt

    arguments = tasks.measure, bags('one', 'two'), configuration, 1, tmp_path / 'kept'
    with pytest.raises(KeyboardInterrupt):
        run_tasks(*arguments, on_done=interrupt)
    assert [outcome.resumed for outcome in run_tasks(*arguments)] == [True, False]


def test_the_key_depends_on_all_that_counts(tmp_path):
    bag = tmp_path / 'bag'
    bag.mkdir()
    (bag / 'bag_0.mcap').write_bytes(b'one')
    seen = {task_key(tasks.measure, bag, {'a': 1})}

    def is_new(key):
        is_so = key not in seen
        seen.add(key)
        return is_so

    assert not is_new(task_key(tasks.measure, bag, {'a': 1}))
    assert is_new(task_key(tasks.measure, bag, AnalysisTask(AnalysisSettings())))
    task = AnalysisTask(AnalysisSettings(), origin=Origin('arm.urdf', 'another command', '1.2.3'))
    assert not is_new(task_key(tasks.measure, bag, task))
    assert is_new(task_key(tasks.measure, bag, {'a': 2}))
    assert is_new(task_key(tasks.scale, bag, {'a': 1}))
    assert is_new(task_key(tasks.measure, bag, {'a': 1}, 'other code'))
    (bag / 'metadata.yaml').write_text('a')
    assert is_new(task_key(tasks.measure, bag, {'a': 1}))
    (bag / 'notes.txt').write_text('not of the recording')
    assert not is_new(task_key(tasks.measure, bag, {'a': 1}))


def test_only_complete_results_are_returned(tmp_path):
    result = {'words': ['a', 'b'], 'nothing': None, 'array': np.eye(2), 'number': np.inf}
    file = tmp_path / 'key'
    save_result(file, result)
    loaded = load_result(file)
    np.testing.assert_array_equal(loaded.pop('array'), np.eye(2))
    assert loaded == {'words': ['a', 'b'], 'nothing': None, 'number': np.inf}
    assert load_result(tmp_path / 'other') is None
    assert list(tmp_path.iterdir()) == [file]
    whole = file.read_bytes()
    for size in (0, 10, len(whole) // 2, len(whole) - 1):
        file.write_bytes(whole[:size])
        assert load_result(file) is None


@pytest.mark.parametrize(('call', 'more'), [
    (os.mkdir, ()), (np.memmap, ('uint8', 'w+', 0, (1,)))])
def test_no_code_of_a_file_runs(call, more, tmp_path):
    class Planted:
        def __reduce__(self):
            return call, (str(tmp_path / 'made'), *more)

    (tmp_path / 'key').write_bytes(pickle.dumps({'result': Planted()}))
    assert load_result(tmp_path / 'key') is None
    assert not (tmp_path / 'made').exists()


def test_a_dask_cluster_gives_the_same(bags, configuration, tmp_path):
    distributed = pytest.importorskip('distributed')
    paths = bags('one', 'refuse', 'three')
    with distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, dashboard_address=None,
            host='127.0.0.1') as cluster:
        reported = []
        outcomes, again = (run_tasks(
            tasks.measure, paths, configuration, dask=cluster.scheduler_address,
            cache=tmp_path / 'kept', on_done=done) for done in (reported.append, None))
    assert [outcome.bag for outcome in outcomes] == paths
    assert [outcome.error for outcome in outcomes] == ['', 'this one cannot be read', '']
    assert [outcome.result and outcome.result['size'] for outcome in outcomes] == [3, None, 5]
    assert len(reported) == 3
    assert [outcome.resumed for outcome in again] == [True, False, True]


def test_a_missing_scheduler_is_reported(bags, configuration):
    pytest.importorskip('distributed')
    with pytest.raises(RobotDynamicsError, match='no-such-scheme'):
        run_tasks(tasks.measure, bags('one'), configuration, dask='no-such-scheme://here')


def test_dask_that_is_not_installed_is_named_with_its_command(bags, configuration, monkeypatch):
    monkeypatch.setitem(sys.modules, 'distributed', None)
    with pytest.raises(MissingDependencyError, match=r'distributed.*pip install.* distributed'):
        run_tasks(tasks.measure, bags('one'), configuration, dask='tcp://here:1')
