"""What `vnca evaluate` says of models beside each other: of the same picture, on the same smoke.

    python benchmarks/styles/beside.py SMOKE OUT.csv [OPTIONS] PICTURE=RUN[=RUN …] [PICTURE=RUN …]

All runs of a picture are compared with it as large, in cells, as the last of them was shown it: a
picture shown smaller is another picture, with other strokes. `--refine` is of rules with a decoder:
others would draw smaller patterns on finer cells, not finer ones. What is measured already in
OUT.csv is not measured again. At the end the table is printed in Markdown.
"""

import sys
from dataclasses import replace
from pathlib import Path

from measure import add_size, measured, rows_of, runs_parser, table, write_rows

from vnca.recipe import PICTURE_CELLS
from vnca.rule.model import MODEL_NAME, Model


def main() -> None:
    """Measure what is missing, and print the table."""
    parser = runs_parser(__doc__, frames="36-47", refine=1)
    add_size(parser)
    asked = parser.parse_args()
    known = rows_of(asked.out)
    for given in asked.runs:
        style, *runs = map(Path, given.split("="))
        cells = Model.load(runs[-1] / MODEL_NAME).training[PICTURE_CELLS]
        for run in runs:
            name = f"{style.stem}, {run.parent.name}"
            if name in known:
                continue
            model = Model.load(run / MODEL_NAME)
            shown = replace(model, training={**model.training, PICTURE_CELLS: cells})
            refine = asked.refine if model.rule.decoder is not None else 1
            known[name] = {"style": name, **measured(shown, style, asked, refine)}
            write_rows(asked.out, known)
            print(name, known[name]["seconds"], "s of processor time", file=sys.stderr, flush=True)
    print(table(known))


if __name__ == "__main__":
    main()
