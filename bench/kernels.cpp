// Times of the kernels on samples of the size training has, beside what the machine can do.
//
//   kernel_bench [--table LOG2] [--levels L] [--features F] [--hidden H] [--threads N] [--seconds S]
//
// Samples lie on rays of 16, as far apart as in the long steps that training starts with. One JSON object: for each
// kernel nanoseconds of a thread a sample (median and least of the repeats) and, where its work is products, GFLOP/s of
// a thread; what a chain of fused multiply-adds and a copy through memory reach on as many threads at once. Every
// thread works on data of its own, as training's threads do.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/kernels/adam_simd.h"
#include "core/kernels/field_mlp_simd.h"
#include "core/kernels/hash_grid_simd.h"
#include "core/kernels/march_ref.h"

namespace fieldgraft {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t samples = 8192, rays = 512;

struct Options {
    int log2_table_size = 17, levels = 8, features = 4, threads = 1;
    int hidden = 64;  // width of the networks' hidden layers, a multiple of 16
    double seconds = 0.3;
};

float next_number(std::uint32_t& state) {
    state = state * 1664525u + 1013904223u;
    return static_cast<float>(state >> 8) * 0x1p-24f;
}

std::vector<float> numbers(std::size_t count, float low, float high, std::uint32_t seed) {
    std::vector<float> values(count);
    for (float& v : values) v = low + (high - low) * next_number(seed);
    return values;
}

// Seconds of every repeat of `work` on each of the threads, all at once.
std::vector<double> times(const Options& options, const std::function<std::function<void()>(int)>& make) {
    std::vector<std::vector<double>> all(options.threads);
    std::vector<std::thread> threads;
    for (int i = 0; i < options.threads; ++i) {
        threads.emplace_back([&, i] {
            const auto work = make(i);
            work();
            using Clock = std::chrono::steady_clock;
            for (const auto begin = Clock::now();
                 all[i].size() < 5 || Clock::now() - begin < std::chrono::duration<double>(options.seconds);) {
                const auto start = Clock::now();
                work();
                all[i].push_back(std::chrono::duration<double>(Clock::now() - start).count());
            }
        });
    }
    for (auto& t : threads) t.join();
    std::vector<double> joined;
    for (const auto& t : all) joined.insert(joined.end(), t.begin(), t.end());
    std::sort(joined.begin(), joined.end());
    return joined;
}

Json row(const std::vector<double>& t, double count, double flops) {
    const double median = t[t.size() / 2];
    Json result{{"ns", median / count * 1e9}, {"least_ns", t.front() / count * 1e9}};
    if (flops > 0) result["gflops"] = flops * count / median * 1e-9;
    return result;
}

// Points along rays of 16 samples, as marching leaves them: 3×n.
std::vector<float> points_on_rays(std::size_t n, std::uint32_t seed) {
    std::vector<float> p(3 * n);
    float at[3] = {}, step[3] = {};
    for (std::size_t i = 0; i < n; ++i) {
        for (int c = 0; c < 3; ++c) {
            if (i % 16 == 0) {
                at[c] = 0.2f + 0.5f * next_number(seed);
                step[c] = 0.0078f * (next_number(seed) - 0.5f);
            }
            p[c * n + i] = at[c] + static_cast<float>(i % 16) * step[c];
        }
    }
    return p;
}

struct Grid {
    HashGrid grid;
    std::vector<float> table;
    explicit Grid(const Options& o)
        : grid(make_hash_grid(o.levels, o.features, o.log2_table_size, 16, 1024)),
          table(numbers(grid.entries * o.features, -1e-2f, 1e-2f, 5)) {}
};

// Sixteen numbers, in as many registers as the machine that builds needs for them.
using Numbers = float __attribute__((vector_size(64)));

// Enough independent chains to hide the latency of an addition; 2·16 operations a chain and step.
constexpr int chains = 12, chain_steps = 4000;
double fused_multiply_adds() {
    Numbers x[chains], factor, more;
    for (int i = 0; i < 16; ++i) {
        factor[i] = 0.999f;
        more[i] = 1e-3f;
        for (int c = 0; c < chains; ++c) x[c][i] = 1.0f + 1e-3f * static_cast<float>(i + c);
    }
    for (int k = 0; k < chain_steps; ++k) {
        for (int c = 0; c < chains; ++c) x[c] = x[c] * factor + more;
    }
    double sum = 0;
    for (const auto& chain : x) sum += static_cast<double>(chain[0]);
    return sum;
}

void add_networks(const Options& o, Precision precision, const std::string& name, Json& out) {
    FieldMlpShape shape;
    shape.hidden = shape.color_hidden = o.hidden;
    struct State {
        std::size_t hidden;
        FieldMlpWeights weights;
        FieldMlpGradients gradients;
        std::vector<float> encoded, features, base, hidden0, hidden1, color, color_grad, base_grad, features_grad,
            encoded_grad;
        std::vector<std::int32_t> ray;
        State(const FieldMlpShape& s, Precision p, int i)
            : hidden(s.hidden),
              weights(s, p),
              gradients(s),
              encoded(numbers(samples * 32, -1, 1, 7 + i)),
              features(samples * 16),
              base(numbers(rays * hidden, -1, 1, 9)),
              hidden0(samples * hidden),
              hidden1(samples * hidden),
              color(samples * 3),
              color_grad(numbers(samples * 3, -1, 1, 11)),
              base_grad(rays * hidden),
              features_grad(samples * 16),
              encoded_grad(samples * 32),
              ray(samples) {
            std::vector<std::vector<float>> m;
            for (const auto& [a, b] : s.matrices()) m.push_back(numbers(a * b, -0.2f, 0.2f, 3));
            weights.pack(FieldMlpMatrices(m.begin(), m.end()));
            for (std::size_t k = 0; k < samples; ++k) ray[k] = static_cast<std::int32_t>(k / 16);
        }
    };
    const auto time = [&](const char* what, double flops, auto body) {
        const auto t = times(o, [&](int i) {
            auto state = std::make_shared<State>(shape, precision, i);
            // Blocks of a thousand samples, as ray passes have them.
            return [state, body] {
                for (std::size_t first = 0; first < samples; first += 1024) body(*state, first);
            };
        });
        out[name + what] = row(t, samples, flops);
    };
    constexpr int n = 1024;
    const double h = o.hidden, density = 2 * (32 * h + h * 16), color = 2 * (16 * h + h * h + h * 3);
    time("density_forward", density, [](State& s, std::size_t f) {
        density_mlp_forward(s.weights, s.encoded.data() + f * 32, n, s.features.data() + f * 16);
    });
    time("density_backward", 2 * density + 2 * 32 * 64, [](State& s, std::size_t f) {
        density_mlp_backward(s.weights, s.encoded.data() + f * 32, s.features_grad.data() + f * 16, n, s.gradients,
                             s.encoded_grad.data() + f * 32);
    });
    time("color_forward", color, [](State& s, std::size_t f) {
        color_mlp_forward(s.weights, s.features.data() + f * 16, s.ray.data() + f, s.base.data(), n,
                          s.hidden0.data() + f * s.hidden, s.hidden1.data() + f * s.hidden, s.color.data() + f * 3);
    });
    time("color_backward", 2 * color, [](State& s, std::size_t f) {
        color_mlp_backward(s.weights, s.features.data() + f * 16, s.ray.data() + f, s.hidden0.data() + f * s.hidden,
                           s.hidden1.data() + f * s.hidden, s.color.data() + f * 3, s.color_grad.data() + f * 3, n,
                           s.gradients, s.base_grad.data(), s.features_grad.data() + f * 16);
    });
}

Json measure(const Options& o) {
    Json out;
    volatile double sink = 0;
    out["machine_fused_multiply_add"] =
        row(times(o, [&](int) { return [&] { sink = fused_multiply_adds(); }; }), 1, 2.0 * 16 * chains * chain_steps);
    const std::size_t bytes = std::size_t{64} << 20;
    const auto copies = times(o, [&](int) {
        auto from = std::make_shared<std::vector<char>>(bytes, 1), to = std::make_shared<std::vector<char>>(bytes, 2);
        return [from, to, bytes] { std::memcpy(to->data(), from->data(), bytes); };
    });
    out["machine_copy"] = {
        {"gbytes_a_second", 2.0 * static_cast<double>(bytes) / copies[copies.size() / 2] * 1e-9 * o.threads}};
    const auto grid = std::make_shared<Grid>(o);
    const std::size_t width = grid->grid.rows();
    out["encode"] =
        row(times(o,
                  [&](int i) {
                      auto p = std::make_shared<std::vector<float>>(points_on_rays(samples, 77 + i));
                      auto e = std::make_shared<std::vector<float>>(samples * width);
                      return [=] { hash_grid_encode(grid->grid, grid->table, p->data(), samples, e->data(), width); };
                  }),
            samples, 0);
    out["encode_gradient"] =
        row(times(o,
                  [&](int i) {
                      auto p = std::make_shared<std::vector<float>>(points_on_rays(samples, 77 + i));
                      auto e = std::make_shared<std::vector<float>>(numbers(samples * width, -1, 1, 3));
                      auto g = std::make_shared<std::vector<float>>(grid->table.size());
                      return [=] {
                          const std::size_t f = static_cast<std::size_t>(grid->grid.features);
                          const HashGridRows part{p->data(), e->data(), samples, f, samples * f};
                          for (std::size_t l = 0; l < grid->grid.levels.size(); ++l)
                              hash_grid_add_gradient(grid->grid, static_cast<int>(l), {&part, 1},
                                                     g->data() + f * grid->grid.levels[l].offset);
                      };
                  }),
            samples, 0);
    const std::size_t entries = grid->table.size();
    out["adam_an_entry"] = row(times(o,
                                     [&](int i) {
                                         auto p = std::make_shared<std::vector<float>>(entries),
                                              m = std::make_shared<std::vector<float>>(entries),
                                              v = std::make_shared<std::vector<float>>(entries);
                                         auto g = std::make_shared<std::vector<float>>(numbers(entries, -1, 1, 3 + i));
                                         return [=] {
                                             AdamStep step;
                                             step.rate = 1e-3;
                                             step.t = 1;
                                             step.skip_zero = true;
                                             adam_step_part(step, *g, *p, *m, *v);
                                         };
                                     }),
                               static_cast<double>(entries), 0);
    add_networks(o, Precision::float32, "float32_", out);
    if (FieldMlpWeights(FieldMlpShape(), Precision::bfloat16).precision() == Precision::bfloat16)
        add_networks(o, Precision::bfloat16, "bfloat16_", out);
    return out;
}

}  // namespace
}  // namespace fieldgraft

int main(int count, char** arguments) {
    fieldgraft::Options options;
    for (int i = 1; i + 1 < count; i += 2) {
        const std::string name = arguments[i];
        const double value = std::atof(arguments[i + 1]);
        if (name == "--table")
            options.log2_table_size = static_cast<int>(value);
        else if (name == "--levels")
            options.levels = static_cast<int>(value);
        else if (name == "--features")
            options.features = static_cast<int>(value);
        else if (name == "--hidden")
            options.hidden = static_cast<int>(value);
        else if (name == "--threads")
            options.threads = static_cast<int>(value);
        else if (name == "--seconds")
            options.seconds = value;
        else
            return std::fprintf(stderr, "kernel_bench: unknown option %s\n", arguments[i]), 2;
    }
    std::printf("%s\n", fieldgraft::measure(options).dump(1).c_str());
}
