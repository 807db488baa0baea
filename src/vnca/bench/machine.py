"""What a run was measured on, and with."""

import platform
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import vnca


def run_facts(device: str, threads: int) -> dict[str, str | int]:
    """What every row of a run, and of no other, shares: when, device, threads and versions."""
    return {
        "date": datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M:%S"),
        "device": device_name(device),
        "threads": threads,
        "torch": _version("torch"),
        "vnca": vnca.__version__,
    }


def device_name(device: str) -> str:
    """What the GPU or the processor is called."""
    if device != "cpu":
        import torch

        return torch.cuda.get_device_name()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(models, platform.processor() or platform.machine())


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"
