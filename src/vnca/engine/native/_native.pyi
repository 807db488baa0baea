from collections.abc import Sequence

from vnca.core import AnyArray, FloatArray, IntArray

def instructions(bfloat16: bool, /) -> list[str]: ...
def multiply_adds(rounds: int, threads: int, bfloat16: bool, instructions: str, /) -> float: ...
def fill(
    values: FloatArray,
    known: AnyArray,
    cells: AnyArray,
    beside: AnyArray,
    threads: int,
    /,
) -> None: ...
def trace(
    velocity: FloatArray,
    bricks: IntArray,
    lower: tuple[int, int, int],
    upper: tuple[int, int, int],
    least: float,
    cells: IntArray,
    times: FloatArray,
    out: FloatArray,
    threads: int,
    /,
) -> None: ...
def carry(
    state: FloatArray,
    bricks: IntArray,
    rows: IntArray,
    lower: tuple[int, int, int],
    upper: tuple[int, int, int],
    circular: bool,
    least: float,
    cells: IntArray,
    moved: FloatArray,
    out: FloatArray,
    threads: int,
    /,
) -> None: ...
def changing_rows(hashes: IntArray, key: int, threshold: int, rows: IntArray, /) -> int: ...
def forward(
    state: FloatArray,
    rows: IntArray,
    neighbours: IntArray,
    priors: FloatArray,
    hidden: FloatArray,
    bias: FloatArray,
    output: FloatArray,
    stencil: FloatArray,
    steering: FloatArray | None,
    out: FloatArray,
    threads: int,
    bfloat16: bool,
    instructions: str,
    /,
) -> None: ...
def forward_bricks(
    state: FloatArray,
    around: IntArray,
    places: IntArray,
    hashes: IntArray,
    key: int,
    threshold: int,
    all: bool,
    priors: FloatArray,
    hidden: FloatArray,
    bias: FloatArray,
    output: FloatArray,
    stencil: FloatArray,
    steering: FloatArray | None,
    out: FloatArray,
    threads: int,
    bfloat16: bool,
    instructions: str,
    /,
) -> None: ...
def backward(
    state: FloatArray,
    rows: IntArray,
    neighbours: IntArray,
    priors: FloatArray,
    hidden: FloatArray,
    bias: FloatArray,
    output: FloatArray,
    stencil: FloatArray,
    steering: FloatArray | None,
    gradient: FloatArray,
    to_state: FloatArray,
    to_hidden: FloatArray,
    to_bias: FloatArray,
    to_output: FloatArray,
    threads: int,
    bfloat16: bool,
    instructions: str,
    /,
) -> None: ...
def decode_instructions() -> list[str]: ...
def decode_forward(
    state: FloatArray,
    rows: IntArray,
    fractions: FloatArray,
    weights: Sequence[FloatArray],
    out: FloatArray,
    threads: int,
    instructions: str,
    /,
) -> None: ...
def decode_parts(
    state: FloatArray,
    cells: IntArray,
    neighbours: IntArray,
    parts: int,
    samples: int,
    weights: Sequence[FloatArray],
    most: float,
    colour: FloatArray,
    change: FloatArray,
    threads: int,
    instructions: str,
    /,
) -> None: ...
def decode_backward(
    state: FloatArray,
    rows: IntArray,
    fractions: FloatArray,
    weights: Sequence[FloatArray],
    gradient: FloatArray,
    to_state: FloatArray,
    to_weights: Sequence[FloatArray],
    threads: int,
    instructions: str,
    /,
) -> None: ...
def show(
    seen: FloatArray,
    most: float,
    colour: FloatArray,
    factor: FloatArray,
    threads: int,
    instructions: str,
    /,
) -> None: ...
def show_backward(
    seen: FloatArray,
    most: float,
    of_colour: FloatArray,
    of_factor: FloatArray,
    gradient: FloatArray,
    threads: int,
    instructions: str,
    /,
) -> None: ...
def find_smoke(
    density: FloatArray, near: AnyArray, threads: int, /
) -> tuple[tuple[int, int, int], tuple[int, int, int]]: ...
def march(
    density: FloatArray,
    near: AnyArray,
    origins: FloatArray,
    directions: FloatArray,
    offsets: FloatArray,
    lower: Sequence[float],
    upper: Sequence[float],
    nearest: float,
    step: float,
    extinction: float,
    most: float,
    threads: int,
    /,
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]: ...
def film(
    density: FloatArray,
    near: AnyArray,
    colour: FloatArray,
    light: tuple[FloatArray, Sequence[float], Sequence[float], FloatArray, float, float] | None,
    origins: FloatArray,
    directions: FloatArray,
    offsets: FloatArray,
    lower: Sequence[float],
    upper: Sequence[float],
    nearest: float,
    step: float,
    extinction: float,
    most: float,
    to_colour: FloatArray,
    passes: FloatArray,
    threads: int,
    /,
) -> None: ...
def smear(
    picture: FloatArray, way: FloatArray, count: int, still: float, to: FloatArray, threads: int
) -> None: ...
def composite(
    starts: IntArray,
    density: FloatArray,
    colour: FloatArray,
    depth: FloatArray,
    extinction: float,
    paper: bool,
    to_colour: FloatArray,
    passes: FloatArray,
    to_depth: FloatArray,
    threads: int,
    /,
) -> None: ...
def composite_backward(
    starts: IntArray,
    density: FloatArray,
    colour: FloatArray,
    depth: FloatArray,
    extinction: float,
    paper: bool,
    of_colour: FloatArray,
    of_passes: FloatArray,
    to_density: FloatArray,
    to_colour: FloatArray,
    threads: int,
    /,
) -> None: ...
