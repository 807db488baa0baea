"""`vnca texture train STYLE --out RUN`, and `vnca texture train --resume RUN`."""

from vnca.cli.train import run_texture as run

__all__ = ["run"]
