#!/usr/bin/env python3
"""What `--backend auto` counts and picks, beside the processor time of both backends.

    tests/bench/backends.py BEAMLET [CASE…]      (needs numpy; cases: those of cases.py, "octagon",
                                                  "cylinders"; the default: all but the long ones)

Seconds are processor time of whole runs. Columns: leaves of the tree, crossings of a ray through the
shadow of the sample, seconds with bvh and with ray-query, the backend that was chosen.
"""
import json
import os
import sys
import tempfile

import cases

SHIPPED = {
    'octagon': ['--set', 'scan.angles=["0 deg", "20 deg"]', '--set', 'detector.pixels=[128, 16]'],
    'cylinders': ['--set', 'detector.pixels=[128, 16]'],
}


def arguments(case, folder):
    if case in SHIPPED:
        return [os.path.join(cases.ROOT, 'docs', 'experiments', case, 'scene.toml'), *SHIPPED[case]]
    return cases.make(case, folder)


def measure(beamlet, case, folder):
    words = arguments(case, folder)
    seconds, record = {}, {}
    for backend in ('auto', 'bvh', 'ray-query'):
        run = os.path.join(folder, 'run-' + backend)
        line = [beamlet, 'simulate', *words, '-o', run, '-q', '--format', 'npy', '--backend', backend]
        _, _, seconds[backend], _ = cases.timed(line)
        with open(os.path.join(run, 'run.json')) as file:
            record[backend] = json.load(file)
    chosen = record['auto']
    search = chosen.get('search') or {}
    row = [f'{search.get("leaves", "none")}', f'{search.get("crossings_per_ray", 0):.2f}',
           f'{seconds["bvh"]:.2f}', f'{seconds["ray-query"]:.2f}', chosen['backend']]
    print(f'| {case} | ' + ' | '.join(row) + ' |', flush=True)


def main():
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    print('| scene | leaves | crossings per ray | s, bvh | s, ray query | chosen |')
    print('|---|---|---|---|---|---|')
    for case in sys.argv[2:] or ['cylinder', 'bracket', 'octagon', 'cylinders', 'tilted', 'bumpy']:
        with tempfile.TemporaryDirectory() as folder:
            measure(os.path.abspath(sys.argv[1]), case, folder)


if __name__ == '__main__':
    main()
