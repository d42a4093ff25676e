#include "core/profile/chart.h"

#include <cairo-svg.h>
#include <cairo.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "core/base/errors.h"
#include "core/base/files.h"

namespace fieldgraft {
namespace {

constexpr double width = 960, height = 600, left = 72, right = 230, top = 48, bottom = 56;

struct Color {
    double r, g, b;
};
// Okabe and Ito's eight, for readers who tell few colours apart, then darker ones.
constexpr std::array<Color, 10> palette{{{0.0, 0.45, 0.70},
                                         {0.84, 0.37, 0.0},
                                         {0.0, 0.62, 0.45},
                                         {0.80, 0.47, 0.65},
                                         {0.90, 0.62, 0.0},
                                         {0.34, 0.71, 0.91},
                                         {0.45, 0.45, 0.45},
                                         {0.60, 0.05, 0.20},
                                         {0.30, 0.20, 0.60},
                                         {0.15, 0.35, 0.10}}};
constexpr Color ink{0.13, 0.13, 0.13}, pale{0.88, 0.88, 0.88}, front_color{0.6, 0.6, 0.6};

struct Range {
    double low, high;
};

// A cairo_t and its surface, closed together.
class Canvas {
  public:
    explicit Canvas(cairo_surface_t* surface)
        : surface_(surface, cairo_surface_destroy), context_(cairo_create(surface), cairo_destroy) {
        cairo_select_font_face(context_.get(), "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
        color({1, 1, 1});
        cairo_paint(context_.get());
    }
    cairo_t* get() const { return context_.get(); }
    cairo_surface_t* surface() const { return surface_.get(); }
    void color(const Color& c) const { cairo_set_source_rgb(context_.get(), c.r, c.g, c.b); }

    // align: 0 starts at x, ½ is centred on it, 1 ends there.
    void text(double x, double y, const std::string& words, double size, double align = 0) const {
        const double start = x - align * length(words, size);
        cairo_move_to(context_.get(), start, y);
        cairo_show_text(context_.get(), words.c_str());
    }
    double length(const std::string& words, double size) const {
        cairo_set_font_size(context_.get(), size);
        cairo_text_extents_t extents;
        cairo_text_extents(context_.get(), words.c_str(), &extents);
        return extents.x_advance;
    }
    void line(double x0, double y0, double x1, double y1, double thickness) const {
        cairo_set_line_width(context_.get(), thickness);
        cairo_move_to(context_.get(), x0, y0);
        cairo_line_to(context_.get(), x1, y1);
        cairo_stroke(context_.get());
    }

  private:
    std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)> surface_;
    std::unique_ptr<cairo_t, decltype(&cairo_destroy)> context_;
};

std::string shown(double value) {
    return fmt::format("{:g}", std::abs(value) < 1e-12 ? 0.0 : value);
}

// The points with the figure, and where they go.
struct Plot {
    std::vector<Point> points;
    std::vector<std::string> knobs;  // in order of appearance
    Range time{}, value{};
    const Measure& measure;

    Plot(const std::vector<Point>& all, const Measure& judged_by) : measure(judged_by) {
        for (const Point& p : all) {
            const auto figure = p.figures.find(measure.figure);
            if (figure == p.figures.end() || !figure->is_number() || !(p.median_seconds() > 0)) continue;
            if (!std::isfinite(figure->get<double>())) continue;
            points.push_back(p);
            if (std::find(knobs.begin(), knobs.end(), p.knob) == knobs.end()) knobs.push_back(p.knob);
        }
        time = {INFINITY, -INFINITY};
        value = time;
        for (const Point& p : points) {
            time = {std::min(time.low, p.median_seconds()), std::max(time.high, p.median_seconds())};
            value = {std::min(value.low, of(p)), std::max(value.high, of(p))};
        }
        const double wide = std::pow(time.high / time.low, 0.06);
        time = {time.low / (1.05 * wide), time.high * 1.1 * wide};
        const double margin = std::max(0.06 * (value.high - value.low), 1e-9 + 1e-3 * std::abs(value.high));
        value = {value.low - margin, value.high + margin};
    }
    double of(const Point& p) const { return p.figures.at(measure.figure).get<double>(); }
    double x(double seconds) const {
        return left + (width - left - right) * std::log(seconds / time.low) / std::log(time.high / time.low);
    }
    double y(double figure) const {
        return height - bottom - (height - top - bottom) * (figure - value.low) / (value.high - value.low);
    }
    Color color(const std::string& knob) const {
        const auto place = std::find(knobs.begin(), knobs.end(), knob) - knobs.begin();
        return palette[static_cast<std::size_t>(place) % palette.size()];
    }
};

void draw_axes(const Canvas& canvas, const Plot& plot, const ChartText& text) {
    for (const double tick : logarithmic_ticks(plot.time.low, plot.time.high)) {
        canvas.color(pale);
        canvas.line(plot.x(tick), top, plot.x(tick), height - bottom, 1);
        canvas.color(ink);
        canvas.text(plot.x(tick), height - bottom + 18, shown(tick), 12, 0.5);
    }
    for (const double tick : linear_ticks(plot.value.low, plot.value.high, 7)) {
        canvas.color(pale);
        canvas.line(left, plot.y(tick), width - right, plot.y(tick), 1);
        canvas.color(ink);
        canvas.text(left - 8, plot.y(tick) + 4, shown(tick), 12, 1);
    }
    canvas.color(ink);
    canvas.text(left, top - 22, text.title, 17);
    canvas.text(0.5 * (left + width - right), height - 14, text.time, 13, 0.5);
    const Measure& m = plot.measure;
    canvas.text(left, top - 6, m.label + (m.unit.empty() ? "" : ", " + m.unit), 13);
}

void draw_front(const Canvas& canvas, const Plot& plot) {
    canvas.color(front_color);
    cairo_set_line_width(canvas.get(), 3);
    double before = 0;
    bool first = true;
    // Steps: until the next point has had its time, nothing better is there.
    for (const std::size_t i : pareto_front(plot.points, plot.measure)) {
        const Point& p = plot.points[i];
        const double x = plot.x(p.median_seconds()), y = plot.y(plot.of(p));
        if (first) {
            cairo_move_to(canvas.get(), x, y);
        } else {
            cairo_line_to(canvas.get(), x, before);
            cairo_line_to(canvas.get(), x, y);
        }
        before = y;
        first = false;
    }
    if (!first) cairo_line_to(canvas.get(), width - right, before);
    cairo_stroke(canvas.get());
}

struct Box {
    double x0, y0, x1, y1;
    bool meets(const Box& other) const { return x0 < other.x1 && other.x0 < x1 && y0 < other.y1 && other.y0 < y1; }
};

void draw_points(const Canvas& canvas, const Plot& plot) {
    std::vector<Box> taken;
    for (const Point& p : plot.points) {
        const double x = plot.x(p.median_seconds()), y = plot.y(plot.of(p));
        taken.push_back({x - 5, y - 5, x + 5, y + 5});
        canvas.color(plot.color(p.knob));
        cairo_arc(canvas.get(), x, y, 5, 0, 2 * M_PI);
        cairo_fill(canvas.get());
        if (!p.usual) continue;
        canvas.color(ink);
        cairo_set_line_width(canvas.get(), 1.5);
        cairo_arc(canvas.get(), x, y, 8, 0, 2 * M_PI);
        cairo_stroke(canvas.get());
    }
    // A label goes where nothing is yet; where all four places are taken the table has to say it.
    constexpr double size = 10;
    for (const Point& p : plot.points) {
        const double x = plot.x(p.median_seconds()), y = plot.y(plot.of(p)), length = canvas.length(p.value, size);
        for (const auto& [dx, dy] : {std::pair{8.0, -3.0}, {8.0, 12.0}, {-8.0 - length, -3.0}, {-8.0 - length, 12.0}}) {
            const Box box{x + dx, y + dy - size, x + dx + length, y + dy + 2};
            const auto meets = [&](const Box& other) { return box.meets(other); };
            if (std::any_of(taken.begin(), taken.end(), meets)) continue;
            taken.push_back(box);
            canvas.color(plot.color(p.knob));
            canvas.text(x + dx, y + dy, p.value, size);
            break;
        }
    }
}

void draw_legend(const Canvas& canvas, const Plot& plot) {
    double y = top + 12;
    const double x = width - right + 18;
    for (const std::string& knob : plot.knobs) {
        canvas.color(plot.color(knob));
        cairo_arc(canvas.get(), x, y - 4, 5, 0, 2 * M_PI);
        cairo_fill(canvas.get());
        canvas.color(ink);
        canvas.text(x + 12, y, knob, 12);
        y += 20;
    }
    canvas.color(front_color);
    canvas.line(x - 6, y - 4, x + 6, y - 4, 3);
    canvas.color(ink);
    canvas.text(x + 12, y, "nothing is both faster and better", 11);
}

void draw(const Canvas& canvas, const Plot& plot, const ChartText& text) {
    if (plot.points.empty()) {
        canvas.color(ink);
        canvas.text(left, top, text.title + ": no points", 17);
        return;
    }
    draw_axes(canvas, plot, text);
    draw_front(canvas, plot);
    draw_points(canvas, plot);
    draw_legend(canvas, plot);
}

void check(cairo_status_t status, const std::filesystem::path& path) {
    if (status != CAIRO_STATUS_SUCCESS)
        failure("{}: the chart could not be written ({})", path.string(), cairo_status_to_string(status));
}

std::filesystem::path with_extension(const std::filesystem::path& base, const char* extension) {
    return base.string() + extension;
}

}  // namespace

std::vector<double> linear_ticks(double low, double high, int count) {
    const double rough = (high - low) / std::max(count, 1);
    if (!(rough > 0) || !std::isfinite(rough)) return {};
    const double decade = std::pow(10, std::floor(std::log10(rough)));
    const double share = rough / decade, step = decade * (share < 1.5 ? 1 : share < 3.5 ? 2 : share < 7.5 ? 5 : 10);
    std::vector<double> ticks;
    for (auto k = static_cast<std::int64_t>(std::ceil(low / step)); static_cast<double>(k) * step <= high; ++k) {
        ticks.push_back(static_cast<double>(k) * step);
    }
    return ticks;
}

std::vector<double> logarithmic_ticks(double low, double high) {
    std::vector<double> ticks;
    if (!(low > 0) || !(high >= low) || !std::isfinite(high)) return ticks;
    for (int decade = static_cast<int>(std::floor(std::log10(low))); std::pow(10, decade) <= high; ++decade) {
        for (const int digit : {1, 2, 5}) {
            const double tick = digit * std::pow(10, decade);
            if (tick >= low && tick <= high) ticks.push_back(tick);
        }
    }
    return ticks;
}

void draw_chart(const std::vector<Point>& points, const Measure& measure, const ChartText& text,
                const std::filesystem::path& base) {
    const Plot plot(points, measure);
    write_atomically(with_extension(base, ".svg"), [&](const std::filesystem::path& path) {
        const Canvas canvas(cairo_svg_surface_create(path.c_str(), width, height));
        draw(canvas, plot, text);
        cairo_surface_finish(canvas.surface());
        check(cairo_surface_status(canvas.surface()), path);
    });
    write_atomically(with_extension(base, ".png"), [&](const std::filesystem::path& path) {
        const Canvas canvas(
            cairo_image_surface_create(CAIRO_FORMAT_RGB24, static_cast<int>(width), static_cast<int>(height)));
        draw(canvas, plot, text);
        check(cairo_surface_write_to_png(canvas.surface(), path.c_str()), path);
    });
}

}  // namespace fieldgraft
