#!/usr/bin/env python3
"""A radiograph by gVirtualXRay and by beamlet: gvxr.py BEAMLET   (see gvxr.sh)

512 x 512 pixels of 37.5 um, 30 keV, a ball of 100,352 triangles with the attenuation of carbon.
gVirtualXRay has a point source and one ray per pixel, and no refraction: for the comparison of images
beamlet takes a point source and a material that does not refract. It averages over each pixel.
"""
import json
import os
import sys
import tempfile
import time

import numpy as np
from gvxrPython3 import gvxr

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', 'bench'))
import cases  # noqa: E402

PIXELS, PITCH, SOURCE, DETECTOR = 512, 37.5, 1.21, 1.8
FRAMES = 5


def beamlet(program, folder, name, *sets):
    """The image of a run, what it took, and its record."""
    run = os.path.join(folder, name)
    arguments = [argument for text in sets for argument in ('--set', text)]
    command = [program, 'simulate', os.path.join(folder, 'scene.toml'), '-o', run, '-q',
               '--format', 'npy', '--backend', 'bvh', *arguments]
    _, clock, cpu, peak = cases.timed(command)
    with open(os.path.join(run, 'run.json')) as file:
        record = json.load(file)
    sample = np.load(os.path.join(run, 'sample.npy'))
    return sample.reshape(PIXELS, PIXELS), clock, cpu, peak, record


def attenuation(program, folder):
    """Attenuation of carbon, 1/m, as beamlet has it."""
    scene = os.path.join(folder, 'scene.toml')
    output, *_ = cases.timed([program, 'check', scene, '--json', '--no-estimate'])
    materials = json.loads(output)['materials']
    return next(material['mu'] for material in materials if material['name'] == 'carbon')


def peer(folder, mu):
    """The image of gVirtualXRay, processor time to the first image, and of one more."""
    began = time.process_time()
    gvxr.createNewContext('EGL', 0)
    gvxr.setSourcePosition(0, -SOURCE, 0, 'm')
    gvxr.usePointSource()
    gvxr.setMonoChromatic(30, 'keV', 1)
    gvxr.setDetectorPosition(0, DETECTOR - SOURCE, 0, 'm')
    gvxr.setDetectorUpVector(0, 0, 1)
    gvxr.setDetectorNumberOfPixels(PIXELS, PIXELS)
    gvxr.setDetectorPixelSize(PITCH, PITCH, 'um')
    context = time.process_time() - began
    began = time.process_time()
    gvxr.loadMeshFile('bumpy', os.path.join(folder, 'bumpy.stl'), 'mm')
    gvxr.setLinearAttenuationCoefficient('bumpy', mu / 100, 'cm-1')
    image = np.array(gvxr.computeXRayImage())
    first = time.process_time() - began
    began = time.process_time()
    for _ in range(FRAMES):
        image = np.array(gvxr.computeXRayImage())
    return image / image.max(), context, first, (time.process_time() - began) / FRAMES


def turned(image, like):
    """The image turned and mirrored so that it lies as another one."""
    ways = [np.rot90(mirrored, turn) for mirrored in (image, image.T) for turn in range(4)]
    return min(ways, key=lambda way: np.sum((way - like) ** 2))


def main():
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    program = os.path.abspath(sys.argv[1])
    with tempfile.TemporaryDirectory() as folder:
        cases.make('radio', folder)
        mu = attenuation(program, folder)
        other, context, first, more = peer(folder, mu)
        plain = f'materials.plain={{mu="{mu!r} /m",delta=0.0}}'
        runs = [
            ('default', []),
            ('tolerance 1e-3', ['sampling.tolerance=1e-3']),
            ('no refraction, point source, tolerance 1e-3',
             ['sampling.tolerance=1e-3', plain, 'object[0].material=plain',
              'source.spot=["0 um", "0 um"]']),
        ]
        print(f'gVirtualXRay: {first:.2f} s of processor time for mesh and first image, '
              f'{more:.3f} s for one more, {context:.1f} s for context and renderer')
        for number, (name, sets) in enumerate(runs):
            image, clock, cpu, peak, record = beamlet(program, folder, f'run{number}', *sets)
            stages = record['seconds']
            traced = stages['trace'] + stages['illuminate']
            print(f'beamlet, {name}: {cpu:.2f} s of processor time, {clock:.2f} s by the clock, of '
                  f'which tracing and light {traced:.2f} s; {peak:.0f} MiB, '
                  f'{record["tally"]["rays"] / PIXELS ** 2:.2f} rays per pixel')
        off = turned(other, image) - image
        depth = np.abs(np.gradient(image)).max(0)
        smooth = depth < np.quantile(depth, 0.95)
        print(f'images differ by {np.sqrt(np.mean(off ** 2)):.1e} rms, {np.abs(off).max():.1e} at most; '
              f'in the 95 % of pixels with the least gradients {np.sqrt(np.mean(off[smooth] ** 2)):.1e} '
              f'rms, {np.abs(off[smooth]).max():.1e} at most')


if __name__ == '__main__':
    main()
