"""What a run survives, measured. Each experiment prints its figures and fails if they are not what they must be.

    python -m benchmarks.faults kills      [--scenes 300] [--seconds-between-kills 4]
    python -m benchmarks.faults restarts   [--scenes 300] [--kills 20]
    python -m benchmarks.faults repairs    [--scenes 2] [--kills 20]
    python -m benchmarks.faults disk       [--scenes 12]            (as root: it mounts a small file system)
    python -m benchmarks.faults container                           (as root: it mounts everything read-only)
    python -m benchmarks.faults corrupt    [--trials 1000]
    python -m benchmarks.faults vouched    [--scenes 2] [--trials 1000]
    python -m benchmarks.faults flips      [--scenes 7] [--flips 200]
    python -m benchmarks.faults memory     [--scenes 500]
    python -m benchmarks.faults throughput [--scenes 60]
    python -m benchmarks.faults nodes      [--scenes 60]

From the root of a checkout. Scenes are the smallest there are: 64 x 32 pixels, one sample, two or three objects.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import astuple, replace
from functools import partial
from itertools import pairwise
from multiprocessing.connection import wait
from pathlib import Path

import numpy as np

from benchmarks.corruption import READERS, damage, make_examples
from datagen import Recipe, StereoDataset, render_dataset
from datagen.dataset.layout import VIEWS
from datagen.dataset.samples import StereoSample
from datagen.dataset.shards import shard_index
from datagen.errors import DatasetError, DiskFullError
from datagen.executors import LocalExecutor, RayExecutor, WorkerPolicy
from datagen.export import EXPORTERS, ExportOptions
from datagen.recipe.recipe import write_recipe
from datagen.sources import webdataset
from datagen.sources.registry import open_source
from datagen.sources.stereo_frame import StereoFrame
from datagen.verify.dataset_check import verify_dataset
from scenes import FAMILIES, scene_to_json
from stereoforge_kit.files import open_tree
from stereoforge_kit.processes import Limits, WorkerError, WorkerProcess
from tests.datagen.sabotage import Sabotage, file_hash, hashes, without
from training.errors import TrainingError

WORLD = FAMILIES["flying_things"].config(
    width=64,
    height=32,
    flying_objects=(1, 1),
    background_objects=(1, 1),
    background_materials=(1, 1),
    pitch_deg=(25.0, 30.0),
)
LIMITS = Limits(timeout_s=60.0, memory_bytes=1500 << 20)


def tiny(scenes: int) -> Recipe:
    return Recipe(WORLD, {"train": scenes}, seed=11, samples=1)


def local(workers: int = 2, policy: WorkerPolicy | None = None) -> LocalExecutor:
    return LocalExecutor(({},) * workers, policy or WorkerPolicy(LIMITS))


def check(what: str, holds: bool) -> None:
    print(f"  {'holds' if holds else 'FAILS'}: {what}", flush=True)
    if not holds:
        sys.exit(1)


def kills(arguments: argparse.Namespace, folder: Path) -> None:
    """Workers killed every few seconds, one scene that segfaults, one that hangs, one that eats memory."""
    count, recipe = arguments.scenes, tiny(arguments.scenes)
    started = time.monotonic()
    render_dataset(recipe, folder / "undisturbed", executor=local())
    print(f"  undisturbed: {2 * (time.monotonic() - started) / count:.1f} s a scene and worker", flush=True)
    bad = [count // 6, count // 2, count - 2]
    names = [f"train/{number:04d}" for number in bad]
    faults = dict(zip(names, ("segfault", "hang", "eat memory"), strict=True))
    with killing_workers(arguments.seconds_between_kills) as killed:
        summary = render_dataset(recipe, folder / "disturbed", executor=Sabotage(local(), faults))
    print(f"  {len(killed)} workers killed; {summary.rendered} scenes committed")
    for entry in summary.failures:
        print(f"  in quarantine: {entry.name} ({entry.kind}, {entry.attempts} attempts): {entry.reason}")
    check("all scenes but three committed", summary.rendered == count - 3)
    check("those three in quarantine", [entry.name for entry in summary.failures] == names)
    expected = without(hashes(folder / "undisturbed"), *(f"{number:04d}" for number in bad))
    check("the same SHA-256 as undisturbed", hashes(folder / "disturbed") == expected)


@contextmanager
def killing_workers(period_s: float) -> Iterator[list[int]]:
    killed: list[int] = []
    over = threading.Event()

    def kill() -> None:
        while not over.wait(random.uniform(0.5, 1.5) * period_s):
            workers = [pid for pid in children_of(os.getpid()) if is_worker(pid)]
            if workers:
                victim = random.choice(workers)
                os.kill(victim, signal.SIGKILL)
                killed.append(victim)

    thread = threading.Thread(target=kill)
    thread.start()
    try:
        yield killed
    finally:
        over.set()
        thread.join()


def children_of(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def is_worker(pid: int) -> bool:
    try:
        return b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return False


def resident_mib(pid: int) -> float:
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * 4096 / 2**20
    except OSError:
        return 0.0


def restarts(arguments: argparse.Namespace, folder: Path) -> None:
    """The whole command killed with -9 at random moments, and started again."""
    recipe, root = tiny(arguments.scenes), folder / "set"
    render_dataset(recipe, folder / "undisturbed", executor=local())
    write_recipe(folder / "recipe.yaml", recipe)
    words = ["render", "--recipe", str(folder / "recipe.yaml"), "--out", str(root), "--workers", "2"]
    command = [sys.executable, "-m", "stereoforge", *words]
    temporary = folder / "temporary"
    temporary.mkdir()
    environment = {**os.environ, "TMPDIR": str(temporary)}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment}
    done, hit = [], 0
    for _ in range(arguments.kills):
        process = subprocess.Popen(command, **quiet)
        time.sleep(random.uniform(0.0, arguments.longest_run))
        hit += process.poll() is None
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        done.append(len(list(root.glob("manifest/TRAIN/A/*.json"))))
    print(f"  scenes committed at each kill: {done}")
    check(f"all {arguments.kills} kills hit a running command", hit == arguments.kills)
    check("the last run succeeds", subprocess.run(command, check=False, **quiet).returncode == 0)
    check("the same SHA-256 as undisturbed", hashes(root) == hashes(folder / "undisturbed"))
    leftovers = [path for path in root.iterdir() if path.name.startswith(".")]
    check("no leftovers in the data set", not leftovers and verify_dataset(root, workers=1).ok)
    check("no leftovers in the folder for temporary files", not list(temporary.iterdir()))


def repairs(arguments: argparse.Namespace, folder: Path) -> None:
    """`verify --repair` killed with -9 at random moments: nothing that was intact is ever lost."""
    recipe, root = tiny(arguments.scenes), folder / "set"
    render_dataset(recipe, folder / "undisturbed", executor=local())
    whole = hashes(folder / "undisturbed")
    shutil.copytree(folder / "undisturbed", root)
    pictures = sorted(root.glob("frames_cleanpass/TRAIN/A/*/left/*.png"))
    for number, path in enumerate(pictures):  # One file of each scene; a manifest now and then.
        victim = root / f"manifest/TRAIN/A/{number:04d}.json" if number % 3 == 2 else path
        victim.write_bytes(victim.read_bytes()[:-20])
    words = ["verify", str(root), "--repair", "--workers", "2"]
    command = [sys.executable, "-m", "stereoforge", *words]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    intact = [intact_files(root, whole)]
    least, hit = len(intact[0]), 0
    for _ in range(arguments.kills):
        process = subprocess.Popen(command, **quiet)
        deadline = time.monotonic() + random.uniform(0.0, arguments.longest_run)
        while process.poll() is None and time.monotonic() < deadline:
            least = min(least, len(intact_files(root, whole)))
            time.sleep(0.05)
        hit += process.poll() is None
        process.kill()
        process.wait()
        intact.append(intact_files(root, whole))
    print(
        f"  {hit} of {arguments.kills} kills hit a running repair; intact files of {len(whole)} after each:"
    )
    print(f"  {list(map(len, intact))}, never fewer than {least}")
    growing = all(before <= after for before, after in pairwise(intact))
    check("no intact file is ever lost", growing and least == len(intact[0]))
    check("the last repair succeeds", subprocess.run(command, check=False, **quiet).returncode == 0)
    check("the same SHA-256 as undisturbed", hashes(root) == whole)
    check("no leftovers", not [path for path in root.iterdir() if path.name.startswith(".")])


def intact_files(root: Path, whole: dict[str, str]) -> set[str]:
    """The names of the files that have their bytes of the undisturbed data set."""
    found = set()
    for name, digest in whole.items():
        with suppress(OSError, ValueError, KeyError):
            if file_hash(root, name) == digest:
                found.add(name)
    return found


def disk(arguments: argparse.Namespace, folder: Path) -> None:
    """A file system that fills up mid-run and gets more room."""
    recipe = tiny(arguments.scenes)
    render_dataset(recipe, folder / "undisturbed", executor=local(1))
    size = sum(path.stat().st_size for path in (folder / "undisturbed").rglob("*") if path.is_file())
    mounted = folder / "disk"
    mounted.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size // 2}", "tmpfs", mounted], check=True)
    try:
        try:
            render_dataset(recipe, mounted / "set", executor=local(1))
            check("the disk fills up", False)
        except DiskFullError as error:
            print(f"  {error}")
        there = hashes(mounted / "set")
        check("nothing but whole scenes is left", there.items() <= hashes(folder / "undisturbed").items())
        subprocess.run(["mount", "-o", f"remount,size={64 << 20}", mounted], check=True)
        render_dataset(recipe, mounted / "set", executor=local(1))
        check("the rerun completes it", hashes(mounted / "set") == hashes(folder / "undisturbed"))
    finally:
        subprocess.run(["umount", mounted], check=True)


def container(_: argparse.Namespace, folder: Path) -> None:
    """The commands as another user, with everything read-only but --out: once with a folder for temporary files."""
    folder.chmod(0o755)
    for name, temporary in (("out-alone", None), ("with-temporary-folder", folder / "temporary")):
        out = folder / name
        writable = [out] if temporary is None else [out, temporary]
        for place in writable:
            place.mkdir(mode=0o777)
            place.chmod(0o777)
        view = f"{out}/set/frames_cleanpass/TRAIN/A/0000/{{}}/0006.png"
        commands = {
            "render": f"render --out {out}/set --scenes 2 --size 160x90 --samples 1",
            "refine": f"refine {view.format('left')} {view.format('right')} --out {out}/refined --device cpu",
            "train": f"train regressor --data {out}/set --preset tiny --steps 2 --crop 128x64 --out {out}/run",
        }
        for what, words in commands.items():
            done = run_contained(words.split(), writable)
            remarks = [line for line in done.stderr.splitlines() if line.strip()]
            print(f"  {name}, {what}: exit code {done.returncode}; {remarks}", flush=True)
            check(f"{what} works, with at most one remark", done.returncode == 0 and len(remarks) <= 1)
        check("no leftovers", not list(out.rglob(".temporary")))


def run_contained(words: list[str], writable: list[Path]) -> subprocess.CompletedProcess[str]:
    """Run a command as nobody, with a HOME that is not there, where only some folders can be written."""
    mounts = [f"mount --bind {place} {place}" for place in writable]
    script = " && ".join(["mount --make-rprivate /", *mounts, "mount -o remount,ro,bind /", 'exec "$@"'])
    # It may read the interpreter wherever it lies, as the files of an image are everybody's to read.
    nobody = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
    nobody += ["--inh-caps=+dac_read_search", "--ambient-caps=+dac_read_search"]
    variables = {"HOME": "/nonexistent", "PATH": "/usr/bin:/bin", "PYTHONPATH": str(Path.cwd())}
    if len(writable) > 1:
        variables["TMPDIR"] = str(writable[1])
    program = [sys.executable, "-m", "stereoforge", *words]
    return subprocess.run(
        ["unshare", "--mount", "sh", "-c", script, "sh", *nobody, *program],
        env=variables,
        capture_output=True,
        text=True,
        check=False,
    )


def corrupt(arguments: argparse.Namespace, folder: Path) -> None:
    """Damaged files through every reader, in a process with 5 seconds and 1 GiB beyond what it starts with."""
    for name, example in make_examples(folder).items():
        if arguments.only and name not in arguments.only:
            continue
        read, good = READERS[name], example.read_bytes()
        rng = np.random.default_rng(0)
        ends: Counter[str] = Counter()
        worker = reader_process(read, example)
        for _ in range(arguments.trials):
            bad = damage(good, rng)
            example.write_bytes(bad)
            for _ in range(2):  # A busy machine may take 5 s from anyone once; what hangs does so again.
                end = outcome_of(worker, read, example)
                if not worker.alive:
                    worker.stop()
                    example.write_bytes(good)
                    worker = reader_process(read, example)
                    example.write_bytes(bad)
                if end != "timeout":
                    break
            ends[end] += 1
        worker.stop()
        print(f"  {name:12} {dict(sorted(ends.items()))}", flush=True)
        check(f"{name}: read or refused in a sentence", set(ends) <= {"read", "refused"})


def reader_process(read: Callable[[Path], object], example: Path) -> WorkerProcess:
    """A worker that has read the intact file, limited to 1 GiB more than that took."""
    first = WorkerProcess()
    run(first, read, example)
    base = first.resident_bytes()
    first.stop()
    worker = WorkerProcess(Limits(timeout_s=300.0, memory_bytes=base + (1 << 30)))
    run(worker, read, example)  # Imports what the reader needs, which is no part of its 5 seconds.
    worker.limits = replace(worker.limits, timeout_s=5.0)
    return worker


def run(worker: WorkerProcess, read: Callable[[Path], object], path: Path) -> None:
    worker.start(read, path)
    while not worker.poll():
        wait(worker.waitables, 0.05)
    worker.result()


def outcome_of(worker: WorkerProcess, read: Callable[[Path], object], path: Path) -> str:
    try:
        run(worker, read, path)
    except WorkerError as error:
        return error.kind
    except (ValueError, TrainingError) as error:
        return "refused" if "\n" not in str(error) else "refused in many lines"
    except Exception as error:
        return f"raised {type(error).__name__}"
    return "read"


def vouched(arguments: argparse.Namespace, folder: Path) -> None:
    """Damaged files of a data set, and damaged shards of it, through all that reads them by a manifest: what comes
    out must be what came out before, or a refusal."""
    root, shards = folder / "set", folder / "shards"
    render_dataset(tiny(arguments.scenes), root, executor=local())
    export(root, "webdataset", shards)
    uses: dict[str, tuple[Path, Callable[[], object]]] = {
        "StereoDataset": (root, lambda: [digest_of(sample) for sample in StereoDataset(root, "train")]),
        **{f"export {kind}": (root, partial(export, root, kind, folder / "out")) for kind in EXPORTERS},
        "shards": (shards, lambda: [frame_digest(f) for f in open_source(str(shards)).frames("train")]),
    }
    files = {
        place: sorted(path for path in place.rglob("*") if path.is_file() and path.parent != root / "logs")
        for place in (root, shards)
    }
    files[root].remove(root / "recipe.yaml")  # How many scenes it promises no manifest knows.
    for name, (place, use) in uses.items():
        rng, ends = np.random.default_rng(2), Counter[str]()
        expected = use()
        for _ in range(arguments.trials):
            path = files[place][int(rng.integers(len(files[place])))]
            good = path.read_bytes()
            path.write_bytes(damage(good, rng))
            clear_caches()
            try:
                ends["the same as before" if use() == expected else "DAMAGE ACCEPTED"] += 1
            except DatasetError:
                ends["refused"] += 1
            path.write_bytes(good)
        clear_caches()
        print(f"  {name:20} {dict(sorted(ends.items()))}", flush=True)
        check(f"{name}: no damage is accepted", not ends["DAMAGE ACCEPTED"])


def clear_caches() -> None:
    for remembered in (shard_index, webdataset._description):
        remembered.cache_clear()


def export(root: Path, kind: str, out: Path) -> dict[str, str]:
    """Export a data set and tell what was written."""
    if out.exists():
        shutil.rmtree(out)
    EXPORTERS[kind]([StereoDataset(root, "train")], open_tree(out), ExportOptions(), lambda *_: None)
    return hashes(out)


def digest_of(sample: StereoSample) -> str:
    """Of every array, and of the scene."""
    arrays = [array for view in VIEWS for array in astuple(sample.view(view))]
    text = scene_to_json(sample.scene_record)
    return hashlib.sha256(b"".join(map(np.ndarray.tobytes, arrays)) + text.encode()).hexdigest()


def frame_digest(frame: StereoFrame) -> str:
    names = ("left", "right", "disparity_left", "disparity_right", "occlusion_left", "object_index_left")
    return hashlib.sha256(b"".join(getattr(frame, name).tobytes() for name in names)).hexdigest()


def flips(arguments: argparse.Namespace, folder: Path) -> None:
    """Single flipped bits anywhere in a data set, one at a time, each to be found by verify."""
    root = folder / "set"
    render_dataset(tiny(arguments.scenes), root, executor=local())
    shutil.rmtree(root / "logs")
    files = sorted(path for path in root.rglob("*") if path.is_file())
    sizes = np.array([path.stat().st_size for path in files])
    rng = np.random.default_rng(1)
    missed = []
    for _ in range(arguments.flips):
        path = files[rng.choice(len(files), p=sizes / sizes.sum())]
        good = path.read_bytes()
        bad = bytearray(good)
        position, bit = int(rng.integers(len(good))), int(rng.integers(8))
        bad[position] ^= 1 << bit
        path.write_bytes(bad)
        try:
            named = any(item.place == path.relative_to(root).as_posix() for item in problems_of(root))
        except DatasetError as error:
            named = path.name in str(error)
        if not named:
            missed.append((path, position, bit))
        path.write_bytes(good)
    report = verify_dataset(root, workers=2)
    print(f"  {report}")
    check(f"all {arguments.flips} flips found, and the file named", not missed)
    check("nothing found without one", report.ok)


def problems_of(root: Path) -> tuple:  # type: ignore[type-arg]
    return verify_dataset(root, workers=None, sampled_pixels=0).problems


def memory(arguments: argparse.Namespace, folder: Path) -> None:
    """Resident memory over a long run of workers that are never recycled."""
    never = WorkerPolicy(LIMITS, jobs_per_worker=10**9, recycle_bytes=10**12)
    samples: list[tuple[float, float]] = []

    def on_scene(done: int, total: int, _: object) -> None:
        workers = [resident_mib(pid) for pid in children_of(os.getpid()) if is_worker(pid)]
        samples.append((resident_mib(os.getpid()), max(workers, default=0.0)))
        if done % 50 == 0:
            print(
                f"  {done}/{total}: parent {samples[-1][0]:.0f} MiB, worker {samples[-1][1]:.0f} MiB",
                flush=True,
            )

    render_dataset(tiny(arguments.scenes), folder / "set", executor=local(1, never), on_scene=on_scene)
    fifth = len(samples) // 5
    for index, who in enumerate(("parent", "worker")):
        second = statistics.median(sample[index] for sample in samples[fifth : 2 * fifth])
        last = statistics.median(sample[index] for sample in samples[-fifth:])
        print(f"  {who}: {second:.0f} MiB in the second fifth of the run, {last:.0f} MiB in the last")
        check(f"{who} grows by less than 5 %", last < 1.05 * second)


def throughput(arguments: argparse.Namespace, folder: Path) -> None:
    """Ray against local, the same workers, in turn and twice, starting up included."""
    recipe, seconds = tiny(arguments.scenes), {"local": [], "ray": []}  # type: ignore[var-annotated]
    for turn in range(2):
        for name, executor in (
            ("local", local()),
            ("ray", RayExecutor(workers=2, policy=WorkerPolicy(LIMITS))),
        ):
            times: list[float] = []
            render_dataset(
                recipe,
                folder / f"{name}{turn}",
                executor=executor,
                on_scene=lambda *_, times=times: times.append(time.monotonic()),
            )
            # From the first scene on: how long a cluster takes to start is another matter.
            seconds[name].append((times[-1] - times[0]) / (len(times) - 1))
    rates = {name: 1 / min(values) for name, values in seconds.items()}
    print(f"  scenes a second: {json.dumps({name: round(rate, 2) for name, rate in rates.items()})}")
    check(f"ray / local = {rates['ray'] / rates['local']:.2f} >= 0.9", rates["ray"] >= 0.9 * rates["local"])


def nodes(arguments: argparse.Namespace, folder: Path) -> None:
    """A Ray cluster of two machines, both of them this one, of which one is killed when a third is done."""
    import ray
    from ray.cluster_utils import Cluster

    recipe, third = tiny(arguments.scenes), arguments.scenes // 3
    render_dataset(recipe, folder / "undisturbed", executor=local())
    os.environ["PYTHONPATH"] = str(
        Path.cwd()
    )  # Ray's workers import what they run from where this process does.
    here = {"num_cpus": 1, "include_dashboard": False, "node_ip_address": "127.0.0.2"}
    cluster = Cluster(initialize_head=True, head_node_args=here)
    times: list[float] = []
    try:
        second = cluster.add_node(num_cpus=1, node_ip_address="127.0.0.3")
        cluster.wait_for_nodes()
        ray.init(cluster.address, _node_ip_address="127.0.0.2", log_to_driver=False, logging_level="ERROR")

        def on_scene(done: int, _: int, __: object) -> None:
            times.append(time.monotonic())
            if done == third:
                cluster.remove_node(second, allow_graceful=False)

        executor = RayExecutor(policy=WorkerPolicy(LIMITS))
        summary = render_dataset(recipe, folder / "set", executor=executor, on_scene=on_scene)
    finally:
        ray.shutdown()
        cluster.shutdown()
    before = (third - 1) / (times[third - 1] - times[0])
    after = (arguments.scenes - third) / (times[-1] - times[third - 1])
    print(f"  scenes a second: {before:.2f} before the loss, {after:.2f} after it")
    check("all scenes committed", (summary.rendered, summary.failures) == (arguments.scenes, ()))
    check("the same SHA-256 as undisturbed", hashes(folder / "set") == hashes(folder / "undisturbed"))


EXPERIMENTS = {
    function.__name__: function
    for function in (
        kills,
        restarts,
        repairs,
        disk,
        container,
        corrupt,
        vouched,
        flips,
        memory,
        throughput,
        nodes,
    )
}
SCENES = {
    "kills": 300,
    "restarts": 300,
    "repairs": 2,
    "disk": 12,
    "vouched": 2,
    "flips": 7,
    "memory": 500,
    "throughput": 60,
    "nodes": 60,
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("experiment", choices=EXPERIMENTS)
    parser.add_argument("--scenes", type=int)
    parser.add_argument("--seconds-between-kills", type=float, default=4.0)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--longest-run", type=float, default=8.0, help="seconds before a kill, at most")
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--only", nargs="*", help="these readers of `corrupt` alone")
    parser.add_argument("--flips", type=int, default=200)
    arguments = parser.parse_args()
    if arguments.scenes is None:
        arguments.scenes = SCENES.get(arguments.experiment, 0)
    started, cpu = time.monotonic(), os.times()
    print(f"{arguments.experiment}: {vars(arguments)}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        EXPERIMENTS[arguments.experiment](arguments, Path(folder))
    used = os.times()
    spent = sum(used[:4]) - sum(cpu[:4])
    print(f"  {time.monotonic() - started:.0f} s, {spent:.0f} s of CPU")


if __name__ == "__main__":
    main()
