"""Data-parallel training on the cores of one machine: one process a core, weights averaged every few steps.

Each process takes its own steps (local SGD, Stich 2019); averaging gradients every step cost much of what the
second core brought, and one thread pool that meets in every operation brought nothing over one core. Rank 0 builds
the run, saves a checkpoint, then starts the others, which restore it; its wish to stop travels with the weights, so
that all ranks take the same number of steps.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import torch
import torch.distributed as dist
from torch import Tensor

RANK = "FIELDGRAFT_WORKER"
GOING, FINISHED, INTERRUPTED = range(3)  # what a rank wishes


def rank() -> int:
    return int(os.environ.get(RANK, "0"))


class Workers:
    """The group of processes; with one process every call is free."""

    def __init__(self, count: int, meeting: Path, arguments: list[str]) -> None:
        self.count, self._children = count, []
        if count == 1:
            return
        if rank() == 0:
            meeting.unlink(missing_ok=True)
            for i in range(1, count):
                command = [sys.executable, *sys.argv, *arguments]
                self._children.append(subprocess.Popen(command, env={**os.environ, RANK: str(i)}))
        dist.init_process_group("gloo", init_method=f"file://{meeting}", rank=rank(), world_size=count)

    @torch.no_grad()
    def average(self, tensors: list[Tensor], stop: int) -> int:
        """Averages the tensors over the ranks, in place; returns the strongest wish to stop of any rank."""
        if self.count == 1:
            return stop
        wishes = torch.tensor([float(stop == FINISHED), float(stop == INTERRUPTED)])
        flat = torch.cat([*(t.flatten() for t in tensors), wishes.to(tensors[0].device)])
        dist.all_reduce(flat)
        wished = INTERRUPTED if flat[-1] > 0 else FINISHED if flat[-2] > 0 else GOING
        flat /= self.count
        at = 0
        for t in tensors:
            t.copy_(flat[at : at + t.numel()].view_as(t))
            at += t.numel()
        return wished

    def close(self) -> None:
        if self.count > 1:
            dist.destroy_process_group()
        for child in self._children:
            child.wait()
