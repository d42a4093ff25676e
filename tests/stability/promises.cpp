#include "tests/stability/ledger.h"

namespace fieldgraft::stability {

namespace {

const char* const of_weights = "Σ of the weights it is made of, each · (1 + depth in front)";
const char* const of_terms = "Σ of the sizes of its terms, each · (1 + depth in front)";

void both(std::vector<Promise>& all, const char* quantity, const char* part, double bound, const char* unit) {
    for (const char* path : {"reference", "SIMD"}) all.push_back({quantity, part, path, bound, unit});
}

std::vector<Promise> made() {
    std::vector<Promise> all;
    both(all, "α", "value", 1e-6, "its value");
    both(all, "α", "gradient", 1e-6, "its value");
    all.push_back({"φ of the conserving weights", "value", "reference", 1e-6, "its value"});
    all.push_back({"φ of the conserving weights", "gradient", "reference", 2e-6, "its value"});
    both(all, "transmittance T", "value", 1e-6, "its value · (1 + depth)");
    both(all, "weights, paper", "value", 1e-6, "its value · (1 + depth in front)");
    both(all, "weights, conserving", "value", 1e-6, "its value · (1 + depth in front)");
    for (const char* quantity : {"colour Cᵝ", "colour of the edit Cᵉ", "E_add", "E_change"})
        both(all, quantity, "value", 1e-6, of_weights);
    both(all, "E_remove, paper", "value", 1e-6, of_terms);
    both(all, "E_remove, visible", "value", 1e-6, of_terms);
    for (const char* quantity : {"light by σᵉ", "light by cᵉ", "light by βσ", "light by βc", "E_add", "E_change",
                                 "E_remove, paper", "E_remove, visible"})
        both(all, quantity, "gradient", 2e-6, of_terms);
    for (const char* quantity : {"plain colour", "depth"})
        all.push_back({quantity, "value", "reference", 1e-6, of_weights});
    all.push_back({"plain transmittance", "value", "reference", 1e-6, "its value · (1 + depth)"});
    for (const char* quantity : {"plain light by σ", "plain light by c"})
        all.push_back({quantity, "gradient", "reference", 2e-6, of_terms});
    for (const char* quantity : {"softplus (density of g)", "bounded sigmoid (β, colour of g)"}) {
        both(all, quantity, "value", 1e-6, "its value · (1 + the size of z)");
        both(all, quantity, "gradient", 1e-6, "its value · (1 + the size of z)");
    }
    both(all, "hash encoding", "value", 1e-6, "largest entry · (1 + resolution)");
    both(all, "hash encoding", "gradient", 1e-6, "Σ of the gradients' sizes · (1 + resolution)");
    both(all, "density network", "value", 4e-6, "Σ of the sizes of its products");
    both(all, "density network", "gradient", 4e-6, "Σ of the sizes of its products");
    both(all, "density network, its matrices", "gradient", 4e-6, "Σ of the sizes of its products");
    for (const char* part : {"value", "gradient"}) {
        all.push_back({"density network", part, "bfloat16", 0x1p-7, "Σ of the sizes of its products"});
        all.push_back({"colour network", part, "SIMD", 4e-6, "Σ of the sizes of its products"});
        all.push_back({"colour network", part, "bfloat16", 3 * 0x1p-7, "Σ of the sizes of its products"});
    }
    all.push_back({"density network, its matrices", "gradient", "bfloat16", 0x1p-7, "Σ of the sizes of its products"});
    all.push_back({"density of f, exp", "value", "torch", 2e-6, "its value · (1 + the size of z)"});
    all.push_back({"density of f, exp", "gradient", "torch", 2e-6, "its value · (1 + the size of z)"});
    all.push_back({"entropy H", "value", "torch", 1e-6, "its value"});
    all.push_back({"entropy H", "gradient", "torch", 1e-6, "log₂ z and log₂ (1 − z), their sizes summed"});
    for (const char* part : {"value", "gradient"}) {
        all.push_back({"L_region", part, "torch", 2e-6, "its value"});
        all.push_back({"L_opacity", part, "torch", 1e-6, part == std::string("value") ? "its value" : "1/S²"});
        all.push_back({"L_global", part, "torch", 2e-6, part == std::string("value") ? "1" : "the gradient's length"});
        all.push_back({"L_dir", part, "torch", 1e-5, part == std::string("value") ? "1" : "the gradient's length"});
    }
    return all;
}

}  // namespace

const std::vector<Promise>& promises() {
    static const std::vector<Promise> all = made();
    return all;
}

}  // namespace fieldgraft::stability
