"""What the targets share: seeds, one execution, and the rules it must keep.

An input ends in success or in a `VncaError`. Anything else is a finding: another exception, a
warning, a crash of the interpreter, more than `SECONDS`, or more memory than four times what the
reader declares as its limit for a file of that size. The inputs are not files yet: each target
builds one around them, so that mutation is not stopped by a checksum or an offset.
"""

import ctypes
import json
import math
import os
import re
import resource
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

import atheris

_ROOT = Path(__file__).resolve().parents[1]
# The sources as they are: atheris cannot look into the loader of an editable installation.
sys.meta_path = [f for f in sys.meta_path if type(f).__name__ != "ScikitBuildRedirectingFinder"]
sys.path.insert(0, str(_ROOT / "src"))

with atheris.instrument_imports(include=["vnca"]):
    from vnca.core.errors import VncaError

SECONDS = 5
SLACK = 4 << 20  # bytes that an execution may take whatever the file: the interpreter's own
_WORK = _ROOT / "build" / "fuzz"
_ODD_VALUES = (
    None, True, False, -1, 0, 1, 2, 0.5, 1e308, math.inf, math.nan, 2**31, 2**63, "", "x", [], {},
    [0], [[]], [-1], {"x": 0},
)  # fmt: skip
_PAGE = resource.getpagesize()
_M_MMAP_THRESHOLD = -3


def fuzz(
    name: str,
    *,
    suffix: str,
    build: Callable[[bytes], bytes],
    read: Callable[[Path], object],
    limit: Callable[[int], int],
    seeds: Iterable[bytes],
    longest: int = 4096,
    between: bytes | None = None,
) -> None:
    """Run libFuzzer with the options of the command line until it ends the process.

    The corpus is kept in `build/fuzz/NAME` and grows from run to run; findings go beside it.

    Args:
        name: Of the target.
        suffix: Of the file.
        build: From an input to the bytes of a file.
        read: The reader under test.
        limit: Bytes of memory that the reader declares for a file of so many bytes.
        seeds: Inputs to start from; their files must be readable.
        longest: Bytes of an input.
        between: What ends JSON at the beginning of an input; it is then also mutated as such.
    """
    shared_memory = Path("/dev/shm")  # nosec B108
    folder = tempfile.TemporaryDirectory(dir=shared_memory if shared_memory.is_dir() else None)
    path = Path(folder.name) / f"file{suffix}"
    corpus = _WORK / name
    corpus.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(seeds):
        path.write_bytes(build(seed))
        read(path)
        (corpus / f"seed-{number:02}").write_bytes(seed)
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", ResourceWarning)  # of the folder, when libFuzzer exits
    statm = os.open("/proc/self/statm", os.O_RDONLY)
    ctypes.CDLL(None).mallopt(_M_MMAP_THRESHOLD, 1 << 20)  # or freed memory would not be counted

    def execute(data: bytes) -> None:
        content = build(data)
        with path.open("wb", buffering=0) as file:
            file.write(content)
        allowed = 4 * limit(len(content)) + SLACK
        used = int(os.pread(statm, 99, 0).split()[0]) * _PAGE
        resource.setrlimit(resource.RLIMIT_AS, (used + allowed, resource.RLIM_INFINITY))
        try:
            read(path)
        except VncaError as error:
            message = str(error)
            assert message.isprintable()
        finally:
            resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY,) * 2)

    options = [f"-timeout={SECONDS}", f"-max_len={longest}", "-print_final_stats=1"]
    options += ["-rss_limit_mb=4096", f"-artifact_prefix={_WORK}/{name}-"]
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    mutators = {}
    if between is not None:
        mutators["custom_mutator"] = partial(_mutated, between)
    atheris.Setup([sys.argv[0], *options, *sys.argv[1:], str(corpus)], execute, **mutators)
    atheris.Fuzz()


def _mutated(between: bytes, data: bytes, longest: int, seed: int) -> bytes:
    """The input with one value of its JSON exchanged; or mutated as libFuzzer does."""
    random = Random(seed)
    begin = data.find(b"{")
    text, *rest = data[begin:].partition(between)
    try:
        if begin < 0 or random.random() < 0.5:
            raise ValueError
        document = json.loads(text)
        parent, key = random.choice(list(_places(document)))
        parent[key] = random.choice((*_ODD_VALUES, random.choice(list(_places(document)))[0]))
        changed = b"".join((data[:begin], json.dumps(document).encode(), *rest))
    except (ValueError, RecursionError, IndexError):
        return atheris.Mutate(data, longest)
    return changed if len(changed) <= longest else data


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Where values stand in a JSON document: what holds them, and under which key."""
    keys = (
        value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    )
    for key in keys:
        yield value, key
        yield from _places(value[key])


def shortened(content: bytes) -> bytes:
    """`content` with runs of zeros as a zero and their length: most of a small file is zeros."""
    return re.sub(rb"\0{1,255}", lambda run: bytes([0, len(run[0])]), content)


def lengthened(data: bytes) -> bytes:
    """The inverse of `shortened`."""
    return re.sub(rb"\0(.)", lambda run: bytes(run[1][0]), data, flags=re.DOTALL)
