// The one door to libtorch: the narrow headers every room needs, precompiled once a room.
// torch/torch.h itself takes ~17 s a file; take extra headers (torch/csrc/autograd/custom_function.h is here already)
// one by one.
#pragma once

#include <ATen/ATen.h>
#include <ATen/Parallel.h>
#include <torch/csrc/autograd/autograd.h>
#include <torch/csrc/autograd/custom_function.h>
#include <torch/csrc/autograd/generated/variable_factories.h>
#include <torch/csrc/autograd/grad_mode.h>
#include <torch/types.h>

namespace fieldgraft {
using torch::Tensor;
}
