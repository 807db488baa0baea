"""Imports once what training needs, then does what `killed.py` does in a copy of itself for each
line it reads: a JSON list of the file for what is printed and the arguments of `killed.py`. It
answers with the exit code.

Checkpoints are written far more often than usual, or a short training would have only the first;
previews are small.
"""

import json
import os
import runpy
import sys
from pathlib import Path

import torch

import vnca.recipe.smoke  # noqa: F401
from vnca.training import run
from vnca.training.checkpoint import Thrift

KILLED = Path(__file__).with_name("killed.py")

torch.optim.Adam([torch.zeros(1, requires_grad=True)])  # the first one imports more than torch did
Thrift.share, Thrift.least_seconds = 0.5, 0.0
run.PREVIEW_SIZE = 32
for line in sys.stdin:
    printed, *arguments = json.loads(line)
    child = os.fork()
    if child == 0:
        handle = os.open(printed, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(handle, 1)
        os.dup2(handle, 2)
        sys.argv = [str(KILLED), *arguments]
        runpy.run_path(str(KILLED), run_name="__main__")
    _, status = os.waitpid(child, 0)
    print(os.waitstatus_to_exitcode(status), flush=True)
