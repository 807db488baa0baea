"""Work for many machines: jobs for render farms, tables of trainings, and what a painting takes.

A `Job` (`job.py`) is a list of commands of vnca, each with those that it waits for. It is made of
shots (`shots.py`) or of a table of trainings (`sweep.py`), and written in the format of a farm
(`formats.py`): each is a file that knows nothing of the others. `plan.py` predicts what a painting
takes of a machine.
"""
