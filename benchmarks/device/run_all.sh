#!/usr/bin/env bash
# Everything there is to test and measure on an NVIDIA GPU, in at most twelve minutes.
#
#   OUT=folder benchmarks/device/run_all.sh [PART...]
#
# Parts, in this order unless named:
#   check tests train paint evaluate     what it computes is held to the reference, to the CPU and
#                                        to itself; where one fails, nothing is timed
#   bench rollout large sweep memcheck   what it costs
# Works from the source tree, without installation and without a network: python3 needs what
# vnca[train] needs, and pytest. Parts that find no time left are named, and count as failed. Tables
# and logs go to $OUT (build/device unless set); tables of a quiet machine are worth keeping in
# benchmarks/results. DEVICE=cpu tries out the first five parts where there is no GPU; SECONDS_LEFT
# and WHOLE (options of whole.py) make all of it shorter.
set -uo pipefail
cd "$(dirname "$0")/../.." || exit
OUT=${OUT:-build/device}
DEVICE=${DEVICE:-cuda}
PYTHON=${PYTHON:-python3}
SECONDS_LEFT=${SECONDS_LEFT:-720}
read -ra WHOLE <<< "${WHOLE:-}"
mkdir -p "$OUT"
export PYTHONPATH=src PYTHONUNBUFFERED=1 DEVICE
unset TRITON_INTERPRET

check() {
    [[ $DEVICE = cpu ]] || nvidia-smi \
        --query-gpu=name,driver_version,memory.total,clocks.sm,clocks.mem --format=csv || return
    "$PYTHON" - << 'PYTHON'
import os
import sys

import numpy
import torch
import triton

from vnca.core.errors import VncaError
from vnca.engine import Compute, choose, device_named, native

device = os.environ["DEVICE"]
print(f"python {sys.version.split()[0]}, numpy {numpy.__version__}, triton {triton.__version__}")
print(f"torch {torch.__version__}, CUDA {torch.version.cuda}")
print(f"native kernel: {native.unavailable() or 'there'}")
try:
    chosen = choose(Compute("auto", device_named(device)), differentiable=True).name
except VncaError as error:
    sys.exit(str(error))
print(f"on {device}, auto takes {chosen}")
if device != "cpu" and chosen != "triton":
    sys.exit("the Triton kernels do not run here")
PYTHON
}

tests() {
    # Most of the time goes into compiling kernels: in parallel, where pytest can do that.
    local workers=()
    "$PYTHON" -c "import xdist" 2> /dev/null && workers=(-n 12)
    "$PYTHON" -m pytest -q -p no:cacheprovider -W default "${workers[@]}" \
        ${TESTS:-tests/engine tests/training/test_deterministic.py}
}

whole() {
    "$PYTHON" benchmarks/device/whole.py "$1" --device "$DEVICE" --out "$OUT" "${WHOLE[@]}"
}
train() { whole train; }
paint() { whole paint; }
evaluate() { whole evaluate; }

bench() { "$PYTHON" benchmarks/device/step.py bench --csv "$OUT/step.csv"; }
large() { "$PYTHON" benchmarks/device/step.py large --csv "$OUT/step.csv"; }
rollout() { "$PYTHON" benchmarks/device/rollout.py --csv "$OUT/rollout.csv"; }
sweep() { "$PYTHON" benchmarks/device/sweep.py --csv "$OUT/sweep.csv"; }

memcheck() {
    command -v compute-sanitizer > /dev/null || { echo "compute-sanitizer is not there"; return; }
    compute-sanitizer --tool memcheck --error-exitcode 1 \
        "$PYTHON" -m pytest -q -p no:cacheprovider -W default tests/engine/test_conformance.py \
        -k "triton and (odd or flat or portions or wraps)"
}

# A part of its own process group, which ends with all that it started when time is up.
within() {
    local seconds=$1
    shift
    export -f "$1" whole
    export OUT PYTHON
    timeout --kill-after=5 "$seconds" bash -c "set -uo pipefail; read -ra WHOLE <<< '${WHOLE[*]}'; $1"
}

failed=0 wrong=0
(($#)) || set -- check tests train paint evaluate bench rollout large sweep memcheck
for name in "$@"; do
    case $name in
        check | tests | train | paint | evaluate) computes=1 ;;
        bench | rollout | large | sweep | memcheck) computes=0 ;;
        *) echo "$name: no such part"; exit 2 ;;
    esac
    if ((wrong && !computes)); then
        echo "== $name: not run, since what is computed is wrong"
        failed=1
        continue
    fi
    left=$((SECONDS_LEFT - SECONDS))
    if ((left < 5)); then
        echo "== $name: not run, no time left"
        failed=1 wrong=$((wrong | computes))
        continue
    fi
    echo "== $name"
    begin=$SECONDS
    within "$left" "$name" 2>&1 | tee "$OUT/$name.log" || {
        failed=1 wrong=$((wrong | computes))
        echo "$name: failed"
    }
    echo "== $name: $((SECONDS - begin)) s"
done
exit $failed
