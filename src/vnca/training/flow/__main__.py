"""`python -m vnca.training.flow --out flow.safetensors` trains the flow network."""

import sys

import tyro

from vnca.core.errors import VncaError
from vnca.training.flow.train import FlowTraining, train

if __name__ == "__main__":
    try:
        train(tyro.cli(FlowTraining, description=__doc__))
    except VncaError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
