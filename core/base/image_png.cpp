#include <png.h>

#include <csetjmp>
#include <vector>

#include "core/base/errors.h"
#include "core/base/image_codecs.h"

namespace fieldgraft::codecs {

namespace {

// libpng reports by longjmp, which must not pass over C++ objects that own something. So the functions that call
// setjmp hold plain values only; whatever owns memory lives in the caller, and the message is kept here.
struct Report {
    char text[160] = "";
};

void on_error(png_structp png, png_const_charp message) {
    auto* report = static_cast<Report*>(png_get_error_ptr(png));
    std::snprintf(report->text, sizeof report->text, "%s", message);
    png_longjmp(png, 1);
}
void on_warning(png_structp, png_const_charp) {}

struct ReadHandle {
    Report report;
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &report, on_error, on_warning);
    png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
    ReadHandle() {
        if (info == nullptr) throw std::bad_alloc();
    }
    ReadHandle(const ReadHandle&) = delete;
    ReadHandle& operator=(const ReadHandle&) = delete;
    ~ReadHandle() { png_destroy_read_struct(&png, &info, nullptr); }
};

bool read_header(ReadHandle& handle, std::FILE* file) {
    if (setjmp(png_jmpbuf(handle.png)) != 0) return false;
    png_init_io(handle.png, file);
    png_read_info(handle.png, handle.info);
    return true;
}

// Asks for RGB or RGBA with 8 or 16 bits a channel (16 in the machine's byte order), values as the file has them.
bool set_transforms(ReadHandle& handle) {
    if (setjmp(png_jmpbuf(handle.png)) != 0) return false;
    png_set_expand(handle.png);
    png_set_gray_to_rgb(handle.png);
    if (png_get_bit_depth(handle.png, handle.info) == 16) png_set_swap(handle.png);
    png_set_interlace_handling(handle.png);
    png_read_update_info(handle.png, handle.info);
    return true;
}

bool read_rows(ReadHandle& handle, png_bytepp rows) {
    if (setjmp(png_jmpbuf(handle.png)) != 0) return false;
    png_read_image(handle.png, rows);
    png_read_end(handle.png, nullptr);
    return true;
}

[[noreturn]] void bad(const ReadHandle& handle, const std::string& where) {
    input_error("{}: damaged or truncated PNG ({}); export the image again", where, handle.report.text);
}

struct WriteHandle {
    Report report;
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &report, on_error, on_warning);
    png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
    WriteHandle() {
        if (info == nullptr) throw std::bad_alloc();
    }
    WriteHandle(const WriteHandle&) = delete;
    WriteHandle& operator=(const WriteHandle&) = delete;
    ~WriteHandle() { png_destroy_write_struct(&png, &info); }
};

bool write_rows(WriteHandle& handle, std::FILE* file, png_bytepp rows, png_uint_32 width, png_uint_32 height,
                int type) {
    if (setjmp(png_jmpbuf(handle.png)) != 0) return false;
    png_init_io(handle.png, file);
    png_set_IHDR(handle.png, handle.info, width, height, 8, type, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
                 PNG_FILTER_TYPE_DEFAULT);
    png_write_info(handle.png, handle.info);
    png_write_image(handle.png, rows);
    png_write_end(handle.png, nullptr);
    return true;
}

}  // namespace

std::array<int, 3> png_size(std::FILE* file, const std::string& where) {
    ReadHandle handle;
    if (!read_header(handle, file)) bad(handle, where);
    const auto type = png_get_color_type(handle.png, handle.info);
    const bool alpha = (type & PNG_COLOR_MASK_ALPHA) != 0 || png_get_valid(handle.png, handle.info, PNG_INFO_tRNS) != 0;
    return {static_cast<int>(png_get_image_height(handle.png, handle.info)),
            static_cast<int>(png_get_image_width(handle.png, handle.info)), alpha ? 4 : 3};
}

Tensor read_png(std::FILE* file, const std::string& where) {
    ReadHandle handle;
    if (!read_header(handle, file)) bad(handle, where);
    const std::int64_t width = png_get_image_width(handle.png, handle.info);
    const std::int64_t height = png_get_image_height(handle.png, handle.info);
    check_size(where, width, height);
    if (!set_transforms(handle)) bad(handle, where);
    const std::int64_t channels = png_get_channels(handle.png, handle.info);
    const bool deep = png_get_bit_depth(handle.png, handle.info) == 16;
    const std::size_t stride = png_get_rowbytes(handle.png, handle.info);
    Tensor image = at::empty({height, width, channels}, deep ? at::kUInt16 : at::kByte);
    std::vector<png_bytep> rows;
    for (std::int64_t y = 0; y < height; ++y)
        rows.push_back(static_cast<png_bytep>(image.mutable_data_ptr()) + y * stride);
    if (!read_rows(handle, rows.data())) bad(handle, where);
    if (!deep) return image;

    Tensor values = at::empty({height, width, channels}, at::kFloat);
    const auto* wide = static_cast<const png_uint_16*>(image.const_data_ptr());
    float* out = values.mutable_data_ptr<float>();
    for (std::int64_t i = 0; i < values.numel(); ++i) out[i] = wide[i] / 65535.0f;
    return values;
}

void write_png(std::FILE* file, const std::string& where, const Tensor& pixels) {
    const std::int64_t height = pixels.size(0), width = pixels.size(1), channels = pixels.size(2);
    std::vector<png_bytep> rows;
    for (std::int64_t y = 0; y < height; ++y) rows.push_back(pixels.data_ptr<std::uint8_t>() + y * width * channels);
    const int type = channels == 1 ? PNG_COLOR_TYPE_GRAY : channels == 3 ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_RGBA;
    WriteHandle handle;
    if (!write_rows(handle, file, rows.data(), static_cast<png_uint_32>(width), static_cast<png_uint_32>(height), type))
        failure("cannot write {}: {}", where, handle.report.text);
}

}  // namespace fieldgraft::codecs
