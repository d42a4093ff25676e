#include <cstdio>

#include <jerror.h>
#include <jpeglib.h>

#include <csetjmp>
#include <vector>

#include "core/base/errors.h"
#include "core/base/image_codecs.h"

namespace fieldgraft::codecs {

namespace {

// As with PNG: libjpeg leaves by longjmp, so functions with setjmp own nothing.
struct Report {
    jpeg_error_mgr manager;
    std::jmp_buf jump;
    char text[JMSG_LENGTH_MAX] = "";
};

void on_error(j_common_ptr info) {
    auto* report = reinterpret_cast<Report*>(info->err);
    info->err->format_message(info, report->text);
    std::longjmp(report->jump, 1);
}

// libjpeg fills what is missing with grey and only warns; here that is an error. Stray bytes between markers are
// harmless and common in cameras' files.
void on_message(j_common_ptr info, int level) {
    if (level >= 0) return;
    const int code = info->err->msg_code;
    if (code != JWRN_EXTRANEOUS_DATA && code != JWRN_ADOBE_XFORM) on_error(info);
}

struct Handle {
    jpeg_decompress_struct info{};
    Report report{};
    Handle() {
        info.err = jpeg_std_error(&report.manager);
        report.manager.error_exit = on_error;
        report.manager.emit_message = on_message;
    }
    Handle(const Handle&) = delete;
    Handle& operator=(const Handle&) = delete;
    ~Handle() { jpeg_destroy_decompress(&info); }
};

bool read_header(Handle& handle, std::FILE* file) {
    if (setjmp(handle.report.jump) != 0) return false;
    jpeg_create_decompress(&handle.info);
    jpeg_stdio_src(&handle.info, file);
    jpeg_read_header(&handle.info, TRUE);
    return true;
}

bool read_rows(Handle& handle, JSAMPLE* pixels) {
    if (setjmp(handle.report.jump) != 0) return false;
    handle.info.out_color_space = JCS_RGB;
    handle.info.dct_method = JDCT_ISLOW;
    jpeg_start_decompress(&handle.info);
    while (handle.info.output_scanline < handle.info.output_height) {
        JSAMPROW row = pixels + std::size_t{3} * handle.info.output_scanline * handle.info.output_width;
        jpeg_read_scanlines(&handle.info, &row, 1);
    }
    jpeg_finish_decompress(&handle.info);
    return true;
}

[[noreturn]] void bad(const Handle& handle, const std::string& where) {
    input_error("{}: damaged or truncated JPEG ({}); export the image again", where, handle.report.text);
}

}  // namespace

std::array<int, 3> jpeg_size(std::FILE* file, const std::string& where) {
    Handle handle;
    if (!read_header(handle, file)) bad(handle, where);
    return {static_cast<int>(handle.info.image_height), static_cast<int>(handle.info.image_width), 3};
}

Tensor read_jpeg(std::FILE* file, const std::string& where) {
    Handle handle;
    if (!read_header(handle, file)) bad(handle, where);
    const std::int64_t width = handle.info.image_width, height = handle.info.image_height;
    check_size(where, width, height);
    Tensor pixels = at::empty({height, width, 3}, at::kByte);
    if (!read_rows(handle, pixels.data_ptr<std::uint8_t>())) bad(handle, where);
    return pixels;
}

}  // namespace fieldgraft::codecs
