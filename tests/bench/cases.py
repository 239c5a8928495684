#!/usr/bin/env python3
"""Rays, processor time and peak memory of whole runs, beside what `beamlet check` estimates.

    tests/bench/cases.py BEAMLET [--counts] [CASE…]   (needs numpy; the default: all but "wide" and "fibres*")
    tests/bench/cases.py BEAMLET --against OTHER [--cache FOLDER] [CASE…]

`--counts` prints the work of the device instead, as where it has memory of its own. `--against` runs two programs
in turns: lines, rays, the least processor time, and the error of the stack with the sample against a run of BEAMLET at
a tenth of the tolerance, which is made once and kept in the cache folder.

    cylinder  docs/experiments/cylinder, 128 x 128 pixels, 11 steps
    bracket   docs/experiments/bracket, 3 views
    tilted    prism of 2,048 sides, 8 mm thick, tilted by 10 degrees; 128 x 4 pixels, 11 steps
    bumpy     star-shaped bumpy ball of 100,352 triangles; 128 x 128 pixels, 11 steps
    radio     the same without masks; 512 x 512 pixels, one frame
    wide      the same by beam tracking: 2048 x 2048 pixels of 9.375 um, sample mask of period
              100 um, one step
    fibres    80,000 fibres of 5 um and thicker ones in 20 mm of polyethylene; 256 x 1 pixels,
              7 steps, one view at 27 degrees, tolerance 5e-3 (and fibres-fine: 1e-3), as one mesh;
              fibres-instances and -instances-fine: by a file of positions; fibres-exact and
              -exact-fine: as circular cylinders

Meshes are written to a temporary folder. Rays are per pixel of the detector and view ("rays"), and
of the patches that the sample touches ("in patches", mean and most). Seconds are processor time of
the whole process ("cpu") and by the clock ("clock"); "check" is what that takes in all. The last two
columns are the estimates of `check` over what the run took.
"""
import argparse
import hashlib
import json
import math
import os
import subprocess
import sys
import tempfile

import numpy as np

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..')
SOURCE = '[source]\ndistance = "{source} m"\nspot = ["30 um", "26 um"]\nenergy = "30 keV"\n\n'
DETECTOR = '[detector]\ndistance = "1.8 m"\npixels = [{0}, {1}]\npitch = "{2} um"\n\n'
MASK = '[{0}]\n{1}material = "gold"\nthickness = "225 um"\n{2}\n\n'
SCAN = '[scan]\nmask_offsets = {{ from = "-{0} um", to = "{0} um", count = {1} }}\n\n'
BOTH_MASKS = (MASK.format('sample_mask', 'distance = "1.2 m"\n', 'projected_aperture = "30 um"')
              + MASK.format('detector_mask', '', 'projected_aperture = "30 um"'))


def mesh_object(name, material):
    return f'[[object]]\nname = "{name}"\nmesh = "{name}.stl"\nunit = "mm"\nmaterial = "{material}"\n\n'


def cylinder_object(name, material, radius, height, sides, place='0 mm'):
    x, y = (place.split(',') + ['0 mm'])[:2]
    shape = f'radius = "{radius} mm", height = "{height} mm", sides = {sides}'
    return (f'[[object]]\nname = "{name}"\nshape = {{ cylinder = {{ {shape} }} }}\n'
            f'material = "{material}"\nposition = ["{x.strip()}", "{y.strip()}", "0 mm"]\n\n')


def fibres_in_places(sides):
    shape = f'radius = "2.5 um", height = "2 mm"{sides}'
    return (f'[[object]]\nname = "fibres"\nshape = {{ cylinder = {{ {shape} }} }}\n'
            f'material = "carbon"\ninstances = "places.csv"\n\n')


def write_stl(path, vertices, triangles):
    record = np.zeros(len(triangles), [('n', '<f4', 3), ('v', '<f4', (3, 3)), ('a', '<u2')])
    record['v'] = vertices[triangles]
    with open(path, 'wb') as out:
        out.write(bytes(80) + np.uint32(len(triangles)).tobytes() + record.tobytes())


def prism(radius, height, sides):
    """Vertices (mm) and triangles of a closed prism along z whose section has the area of the circle."""
    step = 2 * math.pi / sides
    outer = radius * math.sqrt(step / math.sin(step))
    angles = step * (np.arange(sides) + 0.5)
    x, y = outer * np.cos(angles), outer * np.sin(angles)
    low = np.stack([x, y, np.full(sides, -height / 2)], 1)
    vertices = np.concatenate([low, low + [0, 0, height], [[0, 0, -height / 2], [0, 0, height / 2]]])
    a = np.arange(sides)
    b = (a + 1) % sides
    bottom, top = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    triangles = [(a, b, b + sides), (a, b + sides, a + sides), (bottom, b, a), (top, a + sides, b + sides)]
    return vertices, np.concatenate([np.stack(t, 1) for t in triangles])


def copies(vertices, triangles, centres):
    offset = np.concatenate([centres, np.zeros((len(centres), 1))], 1)
    all_vertices = (vertices[None] + offset[:, None]).reshape(-1, 3)
    first = len(vertices) * np.arange(len(centres))
    return all_vertices, (triangles[None] + first[:, None, None]).reshape(-1, 3)


def bumpy(radius=4.0, cuts=112, amplitude=0.04):
    """Octahedron with `cuts` x `cuts` triangles to a face, drawn onto a sphere with smooth bumps, mm."""
    grid = [(i, j) for i in range(cuts + 1) for j in range(cuts + 1 - i)]
    place = {at: number for number, at in enumerate(grid)}
    face = []
    for i, j in grid:
        if i + j < cuts:
            face.append((place[i, j], place[i + 1, j], place[i, j + 1]))
        if i + j < cuts - 1:
            face.append((place[i + 1, j], place[i + 1, j + 1], place[i, j + 1]))
    corner = np.array([(cuts - i - j, i, j) for i, j in grid])
    vertices, triangles = [], []
    for signs in [(x, y, z) for z in (1, -1) for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))]:
        faces = np.array(face) + len(grid) * len(vertices)
        # Whole numbers, so that shared edges are the same; a mirrored face is turned round.
        vertices.append(corner * np.array(signs))
        triangles.append(faces if np.prod(signs) > 0 else faces[:, ::-1])
    vertices, same = np.unique(np.concatenate(vertices), axis=0, return_inverse=True)
    triangles = same.reshape(-1)[np.concatenate(triangles)]
    unit = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    random = np.random.default_rng(1)
    grown = np.ones(len(unit))
    for waves in (5, 9, 17, 33):
        axis = random.normal(size=3)
        along = unit @ (axis / np.linalg.norm(axis))
        grown += amplitude * 5 / waves * np.sin(waves * along + random.uniform(0, 6.28))
    return unit * (radius * grown)[:, None], triangles


def apart(count, radius, disc):
    """Centres of `count` circles in a disc, none nearer than 2.05 radii to another."""
    random = np.random.default_rng(2)
    least = 2.05 * radius
    cells, centres = {}, []
    while len(centres) < count:
        for x, y in random.uniform(-disc, disc, (4096, 2)):
            if math.hypot(x, y) > disc - radius or len(centres) == count:
                continue
            i, j = math.floor(x / least), math.floor(y / least)
            near = (cells.get((a, b)) for a in (i - 1, i, i + 1) for b in (j - 1, j, j + 1))
            if all(math.dist((x, y), other) >= least for cell in near if cell for other in cell):
                cells.setdefault((i, j), []).append((x, y))
                centres.append((x, y))
    return np.array(centres)


def make(case, folder):
    """Writes a case's scene and meshes; the arguments that its commands take."""
    scene = os.path.join(folder, 'scene.toml')
    stl = lambda name, mesh: write_stl(os.path.join(folder, name + '.stl'), *mesh)
    if case in ('cylinder', 'bracket'):
        return [os.path.join(ROOT, 'docs', 'experiments', case, 'scene.toml')]
    # Fixed, so that figures compare.
    arguments = [scene, '--set', 'sampling.angle_tolerance=2 nrad']
    if case == 'tilted':
        vertices, triangles = prism(4.0, 24.0, 2048)
        cos, sin = math.cos(math.radians(10)), math.sin(math.radians(10))
        stl(case, (vertices @ np.array([[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]]), triangles))
        text = DETECTOR.format(128, 4, 150) + BOTH_MASKS + SCAN.format(25, 11)
        text += mesh_object(case, 'carbon')
    elif case in ('bumpy', 'radio', 'wide'):
        stl('bumpy', bumpy())
        text = {
            'bumpy': DETECTOR.format(128, 128, 150) + BOTH_MASKS + SCAN.format(25, 11),
            'radio': DETECTOR.format(512, 512, 37.5),
            'wide': DETECTOR.format(2048, 2048, 9.375) + MASK.format(
                'sample_mask', 'distance = "1.2 m"\n', 'period = "100 um"\naperture = "20 um"'),
        }[case] + mesh_object('bumpy', 'carbon')
    else:
        centres = apart(80000, 0.0025, 1.25) + [0, 5]
        if case in ('fibres', 'fibres-fine'):
            stl('fibres', copies(*prism(0.0025, 2.0, 16), centres))
            fibres = mesh_object('fibres', 'carbon')
        else:
            with open(os.path.join(folder, 'places.csv'), 'w') as out:
                out.write('x_mm,y_mm,z_mm\n' + ''.join(f'{x!r},{y!r},0\n' for x, y in centres.tolist()))
            fibres = fibres_in_places('' if 'exact' in case else ', sides = 16')
        thick = np.array([(0.45 * (i - 3), 0.45 * (j - 2.5) - 5) for i in range(7) for j in range(6)])
        stl('thick', copies(*prism(0.15, 2.0, 128), thick[:39]))
        text = DETECTOR.format(256, 1, 150) + BOTH_MASKS + SCAN.format(30, 7)
        text += cylinder_object('matrix', 'polyethylene', 10, 3, 2048)
        text += fibres + mesh_object('thick', 'carbon')
        for material, place in (('carbon', '5 mm'), ('epoxy', '-5 mm'), ('nylon 66', '-6 mm, -4 mm')):
            text += cylinder_object(material + ' rod', material, 0.5, 2, 256, place)
        tolerance = '1e-3' if case.endswith('-fine') else '5e-3'
        arguments += ['--set', 'scan.angles=["27 deg"]', '--set', f'sampling.tolerance={tolerance}']
    with open(scene, 'w') as out:
        out.write(SOURCE.format(source=1.213 if case.startswith('fibres') else 1.21) + text)
    return arguments


# The peak of a process counts that of the one it was started from, so a small one starts it.
STARTER = '''
import json, os, subprocess, sys, time
began = time.monotonic()
process = subprocess.Popen(sys.argv[1:], stdout=subprocess.PIPE)
output = process.stdout.read()
_, status, usage = os.wait4(process.pid, 0)
clock = time.monotonic() - began
print(json.dumps({"code": os.waitstatus_to_exitcode(status), "clock": clock, "peak": usage.ru_maxrss / 1024,
                  "cpu": usage.ru_utime + usage.ru_stime, "output": output.decode()}))
'''


def timed(command):
    """Output, seconds by the clock, processor time and peak memory (MiB) of a command."""
    starter = [sys.executable, '-c', STARTER, *command]
    done = json.loads(subprocess.run(starter, stdout=subprocess.PIPE, check=True).stdout)
    if done['code'] != 0:
        raise SystemExit(f'{" ".join(command)}: exit code {done["code"]}')
    return done['output'], done['clock'], done['cpu'], done['peak']


def measure(beamlet, case, folder):
    arguments = make(case, folder) + ['--backend', 'bvh']
    output, check_clock, check_cpu, _ = timed([beamlet, 'check', *arguments, '--json'])
    estimate = json.loads(output)['work']['estimate']
    run = os.path.join(folder, 'run')
    _, clock, cpu, peak = timed([beamlet, 'simulate', *arguments, '-o', run, '-q', '--format', 'npy'])
    with open(os.path.join(run, 'run.json')) as file:
        record = json.load(file)
    with open(os.path.join(run, 'scene.toml')) as file:
        pixels = next(line for line in file if line.startswith('pixels'))
    columns, rows = json.loads(pixels.split('=')[1])
    views = max(1, round(estimate['rays'] / max(estimate['rays_per_view'], 1)))
    sampling, rays = record.get('sampling') or {}, record['tally']['rays']
    row = [f'{rays / (columns * rows * views):.1f}',
           f'{sampling.get("mean_rays", 0):.0f} / {sampling.get("most_rays", 0)}',
           f'{cpu:.2f}', f'{clock:.2f}', f'{peak:.0f}', f'{check_cpu:.2f} / {check_clock:.2f}',
           f'{estimate["rays"] / rays:.2f}', f'{estimate["seconds"] / clock:.2f}']
    print(f'| {case} | ' + ' | '.join(row) + ' |', flush=True)


# Runs of each program: those of two alternate, so that a busy machine slows both.
TURNS = 3


def simulated(beamlet, arguments, run):
    """Stack with the sample, record and processor time of a run."""
    command = [beamlet, 'simulate', *arguments, '-o', run, '--overwrite', '-q', '--format', 'npy']
    cpu = timed(command)[2]
    with open(os.path.join(run, 'run.json')) as file:
        return np.load(os.path.join(run, 'sample.npy')), json.load(file), cpu


def reference(beamlet, arguments, run, cache):
    """Stack of the resolved scene of a run at a tenth of its tolerance."""
    with open(os.path.join(run, 'scene.toml')) as file:
        scene = file.read()
    kept = os.path.join(cache, hashlib.sha256(scene.encode()).hexdigest() + '.npy')
    if not os.path.exists(kept):
        tolerance = next(line.split('=')[1] for line in scene.splitlines() if line.startswith('tolerance ='))
        finer = [*arguments, '--set', f'sampling.tolerance={float(tolerance) / 10!r}']
        stack, _, _ = simulated(beamlet, finer, run + '-finer')
        os.makedirs(cache, exist_ok=True)
        np.save(kept, stack)
    return np.load(kept)


def compare(beamlets, case, folder, cache):
    arguments = make(case, folder) + ['--backend', 'bvh']
    runs = [os.path.join(folder, name) for name in ('one', 'other')]
    done = [None, None]
    seconds = [[], []]
    for turn in range(TURNS):
        for at in (0, 1) if turn % 2 == 0 else (1, 0):
            stack, record, cpu = simulated(beamlets[at], arguments, runs[at])
            done[at] = (stack, record)
            seconds[at].append(cpu)
    exact = reference(beamlets[0], arguments, runs[0], cache).astype(float)
    for beamlet, (stack, record), cpu in zip(beamlets, done, map(min, seconds)):
        off = np.abs(stack - exact)
        tally = record['tally']
        told = (record.get('sampling') or {}).get('worst_error', 0)
        row = [os.path.relpath(beamlet), f'{tally["lines"]:,}', f'{tally["rays"]:,}', f'{cpu:.2f}',
               f'{math.sqrt((off ** 2).mean()):.1e}', f'{off.max():.1e}', f'{told:.1e}']
        print(f'| {case} | ' + ' | '.join(row) + ' |', flush=True)


def count(beamlet, case, folder):
    run = os.path.join(folder, 'run')
    command = [beamlet, 'simulate', *make(case, folder), '--backend', 'bvh', '-o', run, '-q', '--profile']
    subprocess.run(command, env=os.environ | {'BEAMLET_STAGING': '1'}, check=True)
    with open(os.path.join(run, 'run.json')) as file:
        profile = json.load(file)['profile']
    kernels, later = profile['kernels'], profile['later_views']
    def mean(start):
        of = [it for name, it in kernels.items() if name.startswith(start) and it['dispatches'] > 0]
        dispatches = sum(it['dispatches'] for it in of)
        return f'{64 * sum(it["groups"] for it in of) / dispatches:,.0f}' if of else ''
    views = max(profile['views'] - 1, 1)
    row = [f'{profile["submissions"]:,}', f'{later["submissions"] / views:,.0f}', f'{later["buffers"] / views:.0f}',
           f'{profile["bytes_to_device"] / 1e6:,.0f} / {profile["bytes_to_host"] / 1e6:,.0f}',
           mean('trace'), mean('exact'), mean('illuminate')]
    print(f'| {case} | ' + ' | '.join(row) + ' |', flush=True)


def main():
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument('beamlet', type=os.path.abspath)
    parser.add_argument('cases', nargs='*', default=['cylinder', 'tilted', 'bumpy', 'radio', 'bracket'])
    parser.add_argument('--counts', action='store_true')
    parser.add_argument('--against', type=os.path.abspath)
    parser.add_argument('--cache', default=os.path.join(tempfile.gettempdir(), 'beamlet-bench'))
    given = parser.parse_intermixed_args()
    if given.against:
        print('| case | program | lines | rays | cpu, s | rms error | worst error | worst told |')
        print('|---|---|---:|---:|---:|---:|---:|---:|')
    elif given.counts:
        print('| case | submissions | a view with the sample | buffers a view | MB to / from the device '
              '| invocations of a dispatch: trace | exact | illuminate |')
        print('|---|---:|---:|---:|---:|---:|---:|---:|')
    else:
        print('| case | rays | in patches | cpu, s | clock, s | peak, MiB | check cpu / clock, s '
              '| rays told / true | time told / true |')
        print('|---|---|---|---|---|---|---|---|---|')
    for case in given.cases:
        with tempfile.TemporaryDirectory() as folder:
            if given.against:
                compare([given.beamlet, given.against], case, folder, given.cache)
            else:
                (count if given.counts else measure)(given.beamlet, case, folder)


if __name__ == '__main__':
    main()
