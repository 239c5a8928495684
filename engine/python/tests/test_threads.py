"""Signals, callbacks, threads, forks, and the end of the process."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import beamlet as bl


def interrupted(work: Callable[[], object], after: float) -> float:
    """Seconds from a SIGINT to the KeyboardInterrupt, of a machine that does nothing else: those of the
    clock, or fewer where other processes took a share of the cores."""
    sent = [(0.0, 0.0)]

    def send() -> None:
        sent[0] = (time.monotonic(), time.process_time())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(after, send)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        # Machines differ: it may be done before the signal comes.
        while True:
            work()
    timer.join()
    clock, busy = time.monotonic() - sent[0][0], time.process_time() - sent[0][1]
    assert clock < 20
    return min(clock, busy + 0.1)


def test_interrupts_of_each_long_step(
    scene: bl.Scene, large: bl.Scene, engine: bl.Engine, tmp_path: Path
) -> None:
    before, path = engine.simulate(scene, seed=1), tmp_path / "run"
    # Time from signal to exception; the machine of CI runs the work itself on all its cores.
    assert interrupted(lambda: engine.simulate(large), 0.5) < 1
    assert interrupted(lambda: engine.simulate_to(large, path, overwrite=True), 0.5) < 1
    assert interrupted(lambda: engine.check(large), 0.3) < 1
    views, rows, columns = 40, 256, 256
    wide = scene.replace("detector.pixels", [columns, rows])
    rng = np.random.default_rng(1)
    # The curve of the set-up, so that every pixel has an answer.
    curve = 1000 * before.flat[:, :1, :1]
    flat = curve * (1 + 0.01 * rng.random((len(curve), rows, columns), dtype=np.float32))
    sample = 0.8 * flat * np.ones((views, 1, 1, 1), np.float32)
    retrieve = lambda: bl.retrieve(  # noqa: E731
        flat, sample, wide.mask_offsets, wide, method="exact-curve", engine=engine
    )
    assert interrupted(retrieve, 0.4) < 1
    turns = wide.replace("scan.angles", {"from": "0 deg", "to": "360 deg", "count": 100})
    sinograms = rng.random((100, rows, columns), dtype=np.float32)
    assert interrupted(lambda: bl.reconstruct(sinograms, turns, engine=engine), 0.4) < 1
    fit = lambda: bl.reconstruct(sinograms, turns, method="cgls", engine=engine)  # noqa: E731
    assert interrupted(fit, 0.4) < 1
    operator = bl.Projector(turns, engine=engine)
    volume = np.ones(operator.volume_shape, np.float32)
    assert interrupted(lambda: operator(volume), 0.3) < 1
    assert interrupted(lambda: operator.T(sinograms), 0.3) < 1
    assert interrupted(lambda: engine.ideal(large, tolerance=1e-7), 0.4) < 1
    assert interrupted(lambda: list(engine.simulate_many([large])), 0.5) < 1
    run = engine.simulate(scene.replace("detector.pixels", [256, 64]))
    assert interrupted(lambda: run.retrieve(method="exact-curve"), 0.2) < 1
    stored = engine.simulate_to(wide, tmp_path / "stored").path
    assert stored is not None
    assert interrupted(lambda: bl.compare(stored, stored), 0.2) < 1
    # The program draws in a process of its own, which ends with the call.
    assert interrupted(lambda: bl.view(wide), 0.2) < 1
    # The engine goes on to serve, and what was interrupted lacks views.
    assert np.array_equal(before.sample, engine.simulate(scene, seed=1).sample)
    try:
        assert len(bl.Run.open(path).sample) < len(large.angles)
    except bl.FileError as error:
        assert re.search("resume|run directory|does not exist", str(error))


def test_progress_rises_and_exceptions_of_callbacks_end_the_work(
    scene: bl.Scene, large: bl.Scene, engine: bl.Engine, tmp_path: Path
) -> None:
    calls: list[tuple[str, float | None]] = []
    engine.simulate(
        scene.replace("detector.pixels", [256, 64]),
        progress=lambda step, share: calls.append((step, share)),
    )
    shares = [share for _, share in calls if share is not None]
    assert shares == sorted(shares) and shares[-1] == pytest.approx(1)

    class Stop(Exception):
        pass

    stopped: list[str] = []

    def stop(step: str, share: float | None) -> None:
        stopped.append(step)
        raise Stop(step)

    with pytest.raises(Stop):
        engine.simulate(large, progress=stop)
    assert len(stopped) == 1
    turns = {"from": "0 deg", "to": "360 deg", "count": 12}
    scan = scene.replace("scan.angles", turns)
    run = engine.simulate(scan)
    images = run.retrieve(method="moments")
    flat, sample = 1000 * run.flat, 1000 * run.sample
    A = bl.Projector(scan, engine=engine)
    stored = engine.simulate_to(scene, tmp_path / "run").path
    assert stored is not None
    for work in (
        lambda: engine.simulate_to(scene, tmp_path / "other", progress=stop),
        lambda: engine.check(large, progress=stop),
        lambda: engine.ideal(scene, progress=stop),
        lambda: run.retrieve(method="moments", progress=stop),
        lambda: bl.retrieve(
            flat, sample, scan.mask_offsets, scan, method="moments", engine=engine, progress=stop
        ),
        lambda: images.reconstruct(progress=stop),
        lambda: images.reconstruct(method="cgls", progress=stop),
        lambda: A(np.ones(A.volume_shape), progress=stop),
        lambda: A.T(np.ones(A.sinograms_shape), progress=stop),
        lambda: bl.compare(stored, stored, progress=stop),
    ):
        with pytest.raises(Stop):
            work()  # type: ignore[no-untyped-call]
    # The engine goes on to serve.
    assert np.array_equal(engine.simulate(scan).sample, run.sample)
    with pytest.raises(TypeError):
        engine.simulate(large, progress=lambda: None)  # type: ignore[arg-type, misc]


def test_interrupted_runs_are_resumed(scene: bl.Scene, engine: bl.Engine, tmp_path: Path) -> None:
    turns = {"from": "0 deg", "to": "360 deg", "count": 16}
    scan = scene.replace("detector.pixels", [48, 16]).replace("scan.angles", turns)

    class Stop(Exception):
        pass

    def stop(step: str, share: float | None) -> None:
        if share and share > 0.2:
            raise Stop

    path = tmp_path / "run"
    with pytest.raises(Stop):
        engine.simulate_to(scan, path, progress=stop)
    first = bl.Run.open(path)
    assert 0 < len(first.sample) < 16 and len(first.axes[0].values) == len(first.sample)
    run = engine.simulate_to(scan, path, resume=True)
    assert run.sample.shape == scan.shape
    assert np.array_equal(run.sample[: len(first.sample)], first.sample)
    assert np.array_equal(run.sample, engine.simulate(scan).sample)


def test_threads_share_an_engine(scene: bl.Scene, engine: bl.Engine) -> None:
    expected = engine.simulate(scene, seed=5).sample
    found: list[np.ndarray] = []
    work = [
        threading.Thread(target=lambda: found.append(engine.simulate(scene, seed=5).sample))
        for _ in range(4)
    ]
    for thread in work:
        thread.start()
    for thread in work:
        thread.join()
    assert len(found) == 4 and all(np.array_equal(sample, expected) for sample in found)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_forks_are_refused(scene: bl.Scene, engine: bl.Engine) -> None:
    engine.simulate(scene)
    code = os.fork()
    if code == 0:
        refused = 0
        for work in (lambda: engine.simulate(scene), bl.Engine, lambda: engine.check(scene)):
            try:
                work()
            except bl.DeviceError as error:
                refused += "spawn" in str(error)
        engine.close()
        os._exit(0 if refused == 3 else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(code, 0)[1]) == 0
    # The parent's device is as it was.
    assert engine.simulate(scene).sample.size


def run_script(text: str, *words: str) -> subprocess.CompletedProcess[str]:
    setup = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
    script = setup + "import beamlet as bl\nfrom conftest import SCENE\n" + textwrap.dedent(text)
    return subprocess.run(
        [sys.executable, "-c", script, *words], capture_output=True, text=True, timeout=600, check=False
    )


def test_processes_end_well_with_open_engines_and_work_in_threads() -> None:
    done = run_script(
        """
        import threading
        scene = bl.Scene.from_dict(SCENE)
        engine = bl.Engine()
        engine.simulate(scene)
        many = scene.replace("detector.pixels", [512, 512]).replace("sampling.tolerance", 1e-6)
        begun = threading.Event()
        work = lambda: engine.simulate(many, progress=lambda step, share: begun.set())
        threading.Thread(target=work, daemon=True).start()
        begun.wait()
        print("end")
        """
    )
    assert (done.returncode, done.stdout) == (0, "end\n"), done.stderr


def test_spawned_processes_work() -> None:
    done = run_script(
        """
        import multiprocessing
        scene = bl.Scene.from_dict(SCENE)
        run = bl.Engine().simulate(scene)
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            # Scenes and images are pickled on their way there and back.
            ideal = pool.apply(scene.ideal, kwds={"most_rays": 64})
            images = pool.apply(run.retrieve, kwds={"method": "moments"})
            print((ideal.transmission == scene.ideal(most_rays=64).transmission).all())
            print(images.scene.shape == scene.shape, (images.flags == run.retrieve("moments").flags).all())
        """
    )
    assert (done.returncode, done.stdout) == (0, "True\nTrue True\n"), done.stderr


def test_many_simulations_leave_memory_flat(scene: bl.Scene) -> None:
    def resident() -> int:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    tiny = scene.replace("detector.pixels", [8, 2])
    with bl.Engine() as engine:
        for run in engine.simulate_many([tiny] * 40):
            assert run.flat.size
        before = resident()
        for _ in engine.simulate_many([tiny] * 80):
            pass
        # A leak of one kernel or band per simulation would be more.
        assert resident() - before < 40 << 20


def test_the_program_is_the_same(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "beamlet"]
    done = subprocess.run([*words, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"beamlet {bl.__version__}\n"
    wrong = subprocess.run([*words, "check", "none.toml"], capture_output=True, text=True, check=False)
    assert wrong.returncode == 1 and "none.toml" in wrong.stderr
    assert subprocess.run([*words, "nonsense"], capture_output=True, check=False).returncode == 2
    subprocess.run([*words, "example", "cylinder", "-o", str(tmp_path)], check=True, capture_output=True)
    assert bl.Scene.load(tmp_path / "scene.toml").shape == (1, 11, 128, 128)
