#!/usr/bin/env bash
# Everything there is to test and measure on an NVIDIA GPU.
#
#   OUT=folder benchmarks/device/run_all.sh [PART...]
#
# Parts, in this order unless named: check, tests, memcheck, bench, large, rollout, sweep. Works from the source tree, without installation and without a network:
# python3 needs torch, triton, numpy, jaxtyping and pytest. A part that fails does not stop the rest;
# the script then ends with 1. Tables and logs go to $OUT (build/device unless set); those of a quiet
# machine are worth keeping in benchmarks/results.
set -uo pipefail
cd "$(dirname "$0")/../.." || exit
OUT=${OUT:-build/device}
mkdir -p "$OUT"
export PYTHONPATH=src PYTHONUNBUFFERED=1
unset TRITON_INTERPRET

check() {
    nvidia-smi --query-gpu=name,driver_version,memory.total,clocks.sm,clocks.mem --format=csv
    python3 - <<'PYTHON'
import sys

import numpy
import torch
import triton

from vnca.engine import native
from vnca.engine import choose

print(f"python {sys.version.split()[0]}, numpy {numpy.__version__}, triton {triton.__version__}")
print(f"torch {torch.__version__}, CUDA {torch.version.cuda}, {torch.cuda.get_device_name()}")
print(f"native kernel: {native.unavailable() or 'there'}")
print(f"auto takes {choose(device='cuda')}")
PYTHON
}

tests() {
    # Most of the time goes into compiling kernels: in parallel, where pytest can do that.
    local workers=()
    python3 -c "import xdist" 2> /dev/null && workers=(-n 12)
    python3 -m pytest -q -p no:cacheprovider -W default "${workers[@]}" tests/engine
}

memcheck() {
    command -v compute-sanitizer > /dev/null || { echo "compute-sanitizer is not there"; return; }
    compute-sanitizer --tool memcheck --error-exitcode 1 \
        python3 -m pytest -q -p no:cacheprovider -W default tests/engine/test_conformance.py \
        -k "triton and (odd or flat or portions or wraps)"
}

bench() { python3 benchmarks/device/step.py bench --csv "$OUT/step.csv"; }

large() { python3 benchmarks/device/step.py large --csv "$OUT/step.csv"; }

rollout() { python3 benchmarks/device/rollout.py --csv "$OUT/rollout.csv"; }

sweep() { python3 benchmarks/device/sweep.py --csv "$OUT/sweep.csv"; }

failed=0
(($#)) || set -- check tests memcheck bench large rollout sweep
for name in "$@"; do
    echo "== $name"
    begin=$SECONDS
    "$name" 2>&1 | tee "$OUT/$name.log" || { failed=1; echo "$name: failed"; }
    echo "== $name: $((SECONDS - begin)) s"
done
exit $failed
