"""`learn_model`: correct a robot's muscle lengths and Jacobian from recorded motion."""

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import yaml

from fastswing_planner.arrays import Matrix
from fastswing_planner.bags import open_bag
from fastswing_planner.command_line import say
from fastswing_planner.errors import InvalidRequest, PlannerError, RobotDescriptionError
from fastswing_planner.learning.fitting import fit_correction
from fastswing_planner.learning.samples import MuscleSamples, muscle_samples
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.learned_model import LearnedMuscleModel, mjcf_hash
from fastswing_planner.robot.length_correction import LengthCorrection, save_correction
from fastswing_planner.robot.path import MUSASHI


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns 0, or 2 after an error of one line."""
    options = _parser().parse_args(arguments)
    try:
        _learn(options)
    except PlannerError as error:
        print(f"learn_model: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="learn_model",
        description="Learn from bags what a robot's muscle lengths differ from its MJCF by; write "
        "it, and a robot description that uses it.",
    )
    parser.add_argument("bag", nargs="+", type=Path, help="MCAP file or folder; several are one")
    parser.add_argument("-o", "--output", required=True, type=Path, help="the new NAME.yaml")
    parser.add_argument("--robot", default=MUSASHI, help="the robot's YAML file")
    parser.add_argument("--prefix", default="", help="namespace of the robot's topics, '/left'")
    parser.add_argument("--samples", type=int, default=10_000, help="at most as many")
    return parser


def _learn(options: argparse.Namespace) -> None:
    output: Path = options.output
    if output.suffix != ".yaml":
        raise InvalidRequest(f"--output is '{output}', its name must end in .yaml")
    for path in (output, output.with_suffix(".npz")):
        if os.path.lexists(path):
            raise InvalidRequest(f"{path} exists and is never overwritten; choose another --output")
    if options.samples < 1:
        raise InvalidRequest(f"--samples is {options.samples}, expected 1 or more")
    robot = load_robot(options.robot)
    bag = open_bag(*options.bag)
    samples = muscle_samples(
        bag, robot.model, robot.wire_stiffness, options.samples, options.prefix
    )
    correction, before = learned(robot, samples)
    save_correction(correction, output.with_suffix(".npz"), mjcf_hash(robot.mjcf))
    write_description(robot, output)
    say(report(correction, before, samples))
    say(f"written: {output}, {output.with_suffix('.npz')}")
    for line in bag.warnings:
        print(f"warning: {line}", file=sys.stderr)


def learned(robot: Robot, samples: MuscleSamples) -> tuple[LengthCorrection, Matrix]:
    """Return the correction, and the MJCF's difference before [m], shape (k, m)."""
    if not len(samples.joint_position):
        raise InvalidRequest("no joint states near the muscle states in time: nothing to learn")
    # The MJCF's own lengths: what a robot that was learned before knows is learned anew.
    model = robot.model.plain if isinstance(robot.model, LearnedMuscleModel) else robot.model
    lengths = np.array([model.lengths(posture) for posture in samples.joint_position])
    difference = np.where(samples.usable, samples.length - lengths, 0.0)
    correction = fit_correction(
        model.joint_names, model.muscle_names, samples.joint_position, difference, samples.usable
    )
    return correction, difference


def write_description(robot: Robot, output: Path) -> None:
    """Write the robot's description again, with the correction; raises RobotDescriptionError."""
    try:
        content = yaml.safe_load(robot.path.read_text(encoding="utf-8"))
        content["mjcf"] = os.path.relpath(robot.mjcf.resolve(), output.parent.resolve())
        content["learned_muscles"] = output.with_suffix(".npz").name
        output.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    except OSError as error:
        raise RobotDescriptionError(f"cannot write {output}: {error.strerror or error}") from error


def report(correction: LengthCorrection, before: Matrix, samples: MuscleSamples) -> str:
    """Return a table of the muscles' errors before and after [mm]."""
    low = samples.joint_position.min(axis=0)
    high = samples.joint_position.max(axis=0)
    lines = [
        f"{len(samples.joint_position)} samples, smooth over {correction.scale:g} rad, refused "
        f"farther than {correction.reach:g} rad from any muscle's taut samples",
        "joint   recorded range [rad]",
    ]
    for name, least, most in zip(correction.joint_names, low, high, strict=True):
        lines.append(f"{name:7} {least:7.3f} to {most:6.3f}")
    lines.append("muscle  error of the MJCF [mm]  held out after learning [mm]")
    for index, name in enumerate(correction.muscle_names):
        values = before[samples.usable[:, index], index]
        after = correction.held_out_rms[index]
        error = np.sqrt((values**2).mean())
        lines.append(f"{name:7} {error * 1e3:8.3f}                {after * 1e3:8.3f}")
    return "\n".join(lines)


if __name__ == "__main__":
    raise SystemExit(main())
