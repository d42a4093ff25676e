"""Train the built-in guidance model and its judge on generated pictures. One command:

    python models/train.py                          both, all stages, to models/guide and models/judge
    python models/train.py --only guide --stage 2   one stage (a stage takes at most 90 minutes)
    python models/train.py --only guide --export DIR            the checkpoint as a guidance folder, no training
    python models/train.py --only guide --from models/guide --stage 3 --minutes 60    train shipped weights further
    python models/train.py --only guide --export DIR --mean-with models/guide    its mean with the shipped weights
    python models/train.py --smoke                  a minute on a small model; fails unless it beats chance clearly

Checkpoints go to models/checkpoints/NAME/ every two minutes; running the same command again goes on from there
(`--fresh` starts over). Stages and losses are described in trainer.py and losses.py. Ctrl-C saves and stops.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import time
from pathlib import Path
from typing import Any

import torch
from data import CROWDED, ROOT, TRUE_CAPTIONS, Singles, Stream, lesson, load_generator_module, read_settings
from evaluate import card, evaluate, heldout_generator, write_figures
from folder import load_folder, mean_weights, save_folder
from losses import HeldOut
from network import CONTEXT_LENGTH, default_config
from tokenizer import CaptionTokenizer, write_text
from trainer import RATE, Trainer
from workers import FINISHED, GOING, INTERRUPTED, Workers, rank

TRUNK = {"width": 32, "layers": (1, 1, 1, 1), "stem_pool": True, "reduce_dim": 32, "text_width": 128}

PLANS: dict[str, dict[str, Any]] = {
    "guide": {
        "seed": 1,
        "split": "train",
        "minutes": (60.0, 90.0, 90.0),
        "pairs": 32,
        "network": TRUNK | {"stages": (0, 1, 2, 3, 4)},
    },
    "judge": {
        "seed": 2,
        "split": "judge_train",
        "minutes": (30.0, 45.0, 30.0),
        "pairs": 24,
        "network": TRUNK | {"stages": (1, 2, 3, 4), "dim": 192, "text_layers": 2},
    },
    "smoke": {
        "seed": 3,
        "split": "train",
        "minutes": (0.5, 0.3, 0.0),
        "pairs": 32,
        "network": TRUNK | {"stages": (1, 2, 3, 4), "dim": 128, "text_layers": 2},
    },
}
CHECKPOINT_MINUTES = 2.0
LONGEST_STEP = 30.0  # seconds
TOKENIZER_PAIRS = 6000
LESSONS = 4  # steps of rising difficulty in stage 1 before the full one


class Run:
    """Training of one of the two models: its generator, its trainer, its files."""

    def __init__(self, name: str, args: argparse.Namespace) -> None:
        self.name, self.args, self.plan = name, args, PLANS[name]
        self.folder = args.checkpoints / name
        settings = read_settings(args.settings) if args.settings else json.dumps(TRUE_CAPTIONS)
        split, seed = self.plan["split"], self.plan["seed"]
        module = load_generator_module()
        resumed = (self.folder / "latest.pt").exists() and (rank() > 0 or not (args.fresh or args.start))
        # Each run and each worker draws pictures of its own: a resumed one must not see the same again.
        stream_seed = seed * 1_000_003 + (int(time.time()) % 1_000_000 if resumed else 0) + 500_009 * rank()
        self.generator = module.Generator(seed=stream_seed, split=split, size=64, settings=settings)
        self.lessons = [
            module.Generator(seed=stream_seed + 31 * i, split=split, size=64, settings=lesson(i / LESSONS))
            for i in range(LESSONS if not args.settings else 0)
        ]
        self.crowded = module.Generator(seed=stream_seed + 997, split=split, size=64, settings=json.dumps(CROWDED))
        self.vocabulary = self.generator.vocabulary()
        self.tokenizer, config = self._tokenizer_and_config(resumed)
        held_out = HeldOut.of(module, self.vocabulary)
        self.trainer = Trainer(config, self.tokenizer, self.vocabulary, held_out, seed, args.device, args.rate)
        if resumed:
            self.trainer.restore(self.folder / "latest.pt")
            self.take_again(args.again)
        elif args.start is not None:
            self.trainer.adopt(load_folder(args.start)[0])
        self.at = self.trainer.progress.pictures
        self.say(
            event="start",
            resumed=resumed,
            config=config["vision_config"],
            vocabulary=len(self.tokenizer.vocab),
            parameters=sum(p.numel() for p in self.trainer.model.parameters()),
        )

    def take_again(self, stage: int | None) -> None:
        """Take this stage and those after it once more."""
        progress = self.trainer.progress
        if stage is not None and rank() == 0:
            progress.stage, progress.minutes, progress.stage_steps = stage, 0.0, 0
            progress.done = [s for s in progress.done if s < stage]

    def gather(self) -> None:
        """Start the other workers, which pick up the checkpoint written here."""
        if rank() == 0:
            self.trainer.save(self.folder / "latest.pt")
        self.trainer.workers = Workers(self.args.workers, self.folder / "meeting", ["--only", self.name])
        self.trainer.rng.manual_seed(self.plan["seed"] + 7919 * rank() + self.trainer.progress.steps)
        signal.signal(signal.SIGINT, lambda *_: setattr(self.trainer, "wish", INTERRUPTED))

    def _tokenizer_and_config(self, resumed: bool) -> tuple[CaptionTokenizer, dict[str, Any]]:
        if resumed or self.args.start is not None:
            source = self.folder if resumed else self.args.start
            config = json.loads((source / "config.json").read_text(encoding="utf-8"))
            if self.args.layers:
                config["vision_config"]["layers"] = list(self.args.layers)
            tokenizer = CaptionTokenizer.load(source, CONTEXT_LENGTH)
            if rank() == 0:
                tokenizer.save(self.folder)
                write_text(self.folder / "config.json", json.dumps(config))
            return tokenizer, config
        captions: list[str] = []
        pairs = TOKENIZER_PAIRS if self.name != "smoke" else 500
        for _ in range(pairs // 100):
            raw = self.generator.batch(100, threads=self.args.threads)
            captions += [c for pair in raw["captions"] for c in pair]
            captions += [q for pair in raw["queries"] for picture in pair for q in picture]
        frames = ("{}", "a picture of something {}", "an image of a {}", "a rendering of {} thing", "an object")
        captions += [t.format(w) for t in frames for words in self.vocabulary.values() for w in words]
        tokenizer = CaptionTokenizer.train(captions, CONTEXT_LENGTH)
        config = default_config(vocab_size=len(tokenizer.vocab), **self.plan["network"])
        tokenizer.save(self.folder)
        write_text(self.folder / "config.json", json.dumps(config))
        return tokenizer, config

    def say(self, **event: Any) -> None:
        if rank() == 0:
            rounded = {k: round(v, 4) if isinstance(v, float) else v for k, v in event.items()}
            print(json.dumps({"model": self.name, **rounded}), flush=True)

    def stage(self, stage: int, minutes: float) -> bool:
        """Train one stage up to its minutes; false when interrupted."""
        progress = self.trainer.progress
        if stage in progress.done:
            return True
        if progress.stage != stage:
            progress.stage, progress.minutes, progress.stage_steps = stage, 0.0, 0
        stream = Stream(self.generator, self.plan["pairs"], seed=rank())
        pictures = Singles(stream, 2 * self.plan["pairs"], self.trainer.rng) if stage == 1 else stream
        last = time.monotonic()
        due = {"say": last, "save": last, "check": last, "export": last}
        while self.trainer.stop == GOING:
            # Stage 1 starts with easy pictures; its last fifth has the full difficulty.
            level = int(progress.minutes / minutes * (LESSONS + 1))
            easy = stage == 1 and level < len(self.lessons)
            crowded = stage > 1 and progress.steps % 4 > 1  # half of the batches, as the stream draws every second one
            stream.generator = self.lessons[level] if easy else self.crowded if crowded else self.generator
            self.trainer.step(next(pictures), progress.minutes / minutes)
            now = time.monotonic()
            # A step that took very long was suspended: that is no training time.
            passed = min(now - last, LONGEST_STEP)
            progress.minutes += passed / 60
            progress.seconds += passed
            last = now
            if rank() == 0:
                if progress.minutes >= minutes and self.trainer.wish == GOING:
                    self.trainer.wish = FINISHED
                self.housekeeping(due, now)
        stream.close()
        finished = self.trainer.stop == FINISHED
        self.trainer.stop = self.trainer.wish = GOING
        if finished:
            progress.done.append(stage)
        if rank() == 0:
            self.trainer.save(self.folder / "latest.pt")
        return finished

    def housekeeping(self, due: dict[str, float], now: float) -> None:
        """What happens every so often: a line, a checkpoint, a held-out check, a snapshot."""
        args, progress = self.args, self.trainer.progress
        if now - due["say"] > 20:
            self.say(
                event="progress",
                stage=progress.stage,
                minutes=progress.minutes,
                steps=progress.steps,
                pictures=progress.pictures,
                rate=(progress.pictures - self.at) / (now - due["say"]),
                **self.trainer.recent,
            )
            due["say"], self.at = now, progress.pictures
        if now - due["save"] > 60 * CHECKPOINT_MINUTES:
            self.trainer.save(self.folder / "latest.pt")
            due["save"] = now
        if args.check_minutes and now - due["check"] > 60 * args.check_minutes:
            self.check()
            due["check"] = now
        if args.snapshots and progress.stage > 1 and now - due["export"] > 60 * args.snapshot_minutes:
            self.export(args.snapshots / self.name)
            due["export"] = now

    def check(self, pictures: int = 512) -> dict[str, float]:
        figures, _ = evaluate(self.trainer.averaged(), self.tokenizer, heldout_generator(seed=777), pictures)
        progress = self.trainer.progress
        self.say(event="held-out", stage=progress.stage, pictures=progress.pictures, **figures)
        return figures

    def export(self, folder: Path, pictures: int = 0) -> None:
        """The averaged weights as a guidance folder, with figures and card when `pictures` are asked for."""
        model, progress = self.trainer.averaged(), self.trainer.progress
        if self.args.mean_with is not None:
            model.load_state_dict(mean_weights(model.state_dict(), load_folder(self.args.mean_with)[0].state_dict()))
        text = None
        if pictures:
            generator = heldout_generator()
            figures, seen = evaluate(model, self.tokenizer, generator, pictures)
            history = (
                f"Trained on {progress.pictures:,} pictures in {progress.seconds / 60:.0f} minutes "
                f"({progress.steps:,} steps; complete stages: {', '.join(map(str, progress.done)) or 'none'})."
            )
            text = card(self.name, model.config, figures, seen, history, pictures, self.vocabulary)
            self.say(event="figures", **figures)
        size = save_folder(folder, model.config, model.state_dict(), self.tokenizer, text)
        if pictures:
            write_figures(folder, figures)
        self.say(event="exported", folder=str(folder), bytes=size, pictures=progress.pictures)


def smoke(args: argparse.Namespace) -> int:
    """A minute of stages 1 and 2 on a small model: losses must fall, colour and shape clearly beat chance."""
    args.fresh, args.checkpoints = True, args.checkpoints / "smoke"
    run = Run("smoke", args)
    for stage, minutes in ((1, args.minutes[0] * 0.6), (2, args.minutes[0] * 0.4)):
        run.stage(stage, minutes)
    figures = run.check()
    chance = 1 / len(run.vocabulary["colours"])
    good = figures["colour"] > 1.4 * chance and figures["shape"] > 1.5 / len(run.vocabulary["shapes"])
    run.say(event="done", passed=good, chance_colour=chance, **figures)
    return 0 if good else 1


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=("guide", "judge"))
    parser.add_argument("--stage", type=int, choices=(1, 2, 3), help="only this stage")
    parser.add_argument(
        "--minutes",
        type=lambda t: tuple(float(x) for x in t.split(",")),
        help="minutes a stage: one number, or three separated by commas",
    )
    parser.add_argument("--workers", type=int, default=2, help="processes that share the work")
    parser.add_argument("--threads", type=int, default=1, help="threads of each process")
    parser.add_argument("--device", default="cpu", choices=("cpu", "cuda"))
    parser.add_argument("--rate", type=float, default=RATE, help="peak learning rate")
    parser.add_argument("--from", dest="start", type=Path, help="start from this guidance folder's weights")
    parser.add_argument("--again", type=int, choices=(1, 2, 3), help="take the stages from this one on once more")
    parser.add_argument(
        "--layers",
        type=lambda t: tuple(int(x) for x in t.split(",")),
        help="blocks of the trunk's four layers, four numbers separated by commas; a resumed smaller trunk grows",
    )
    parser.add_argument("--fresh", action="store_true", help="ignore the checkpoint")
    parser.add_argument("--settings", type=Path, help="generator settings (JSON); default: its own, true captions")
    parser.add_argument("--checkpoints", type=Path, default=ROOT / "models" / "checkpoints")
    parser.add_argument("--check-minutes", type=float, default=4.0, help="minutes between held-out checks; 0: none")
    parser.add_argument("--snapshots", type=Path, help="export here while stages 2 and 3 run")
    parser.add_argument("--snapshot-minutes", type=float, default=10.0)
    parser.add_argument("--export", type=Path, help="write the checkpoint as a folder and stop")
    parser.add_argument("--mean-with", type=Path, help="export the mean of the weights and this folder's")
    parser.add_argument("--pictures", type=int, default=4096, help="pictures of the final evaluation")
    parser.add_argument("--smoke", action="store_true")
    return parser.parse_args()


def main() -> int:
    args = parse()
    torch.set_num_threads(args.threads)
    if args.smoke:
        args.workers = 1
        args.minutes = args.minutes or (1.0,)
        return smoke(args)
    for name in [args.only] if args.only else ["guide", "judge"]:
        run = Run(name, args)
        if args.export:
            run.export(args.export, args.pictures)
            continue
        run.gather()
        minutes = args.minutes or run.plan["minutes"]
        for stage in [args.stage] if args.stage else [1, 2, 3]:
            if not run.stage(stage, minutes[stage - 1] if len(minutes) == 3 else minutes[0]):
                run.say(event="interrupted", stage=stage)
                return 130
        run.trainer.workers.close()
        if rank() == 0 and 3 in run.trainer.progress.done:
            run.export(ROOT / "models" / name, args.pictures)
    return 0


if __name__ == "__main__":
    sys.exit(main())
