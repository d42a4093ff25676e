#include <OpenEXR/ImfArray.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>

#include <vector>

#include "core/base/errors.h"
#include "core/base/image_codecs.h"

namespace fieldgraft::codecs {

namespace {

std::string channel_names(const Imf::ChannelList& channels) {
    std::string names;
    for (auto channel = channels.begin(); channel != channels.end(); ++channel)
        names += (names.empty() ? "" : ", ") + std::string(channel.name());
    return names;
}

// The file's channels in our order: R G B [A], or Y three times [A].
std::vector<std::string> chosen_channels(const Imf::ChannelList& channels, const std::string& where) {
    const auto has = [&](const char* name) { return channels.findChannel(name) != nullptr; };
    std::vector<std::string> names;
    if (has("R") && has("G") && has("B")) {
        names = {"R", "G", "B"};
    } else if (has("Y") && !has("RY") && !has("BY")) {
        names = {"Y", "Y", "Y"};
    } else {
        input_error("{}: EXR without channels R, G, B or Y (it has {}); export one plain layer", where,
                    channel_names(channels));
    }
    if (has("A")) names.push_back("A");
    return names;
}

// Turns the library's exceptions into one line that names the file.
template <class Function>
auto guarded(const std::string& where, const Function& function) {
    try {
        return function();
    } catch (const InputError&) {
        throw;
    } catch (const std::exception& error) {
        std::string reason = error.what();
        for (char& c : reason)
            if (c == '\n') c = ' ';
        input_error("{}: damaged or truncated EXR ({}); export the image again", where, reason);
    }
}

}  // namespace

std::array<int, 3> exr_size(const std::string& where) {
    return guarded(where, [&]() -> std::array<int, 3> {
        const Imf::InputFile file(where.c_str(), 1);
        const auto window = file.header().dataWindow();
        const auto names = chosen_channels(file.header().channels(), where);
        return {window.max.y - window.min.y + 1, window.max.x - window.min.x + 1, static_cast<int>(names.size())};
    });
}

Tensor read_exr(const std::string& where) {
    return guarded(where, [&] {
        Imf::InputFile file(where.c_str(), 1);
        const auto window = file.header().dataWindow();
        const std::int64_t width = std::int64_t{window.max.x} - window.min.x + 1;
        const std::int64_t height = std::int64_t{window.max.y} - window.min.y + 1;
        check_size(where, width, height);
        const auto names = chosen_channels(file.header().channels(), where);
        const bool grey = names[0] == "Y";
        const auto channels = static_cast<std::int64_t>(names.size());
        Tensor image = at::zeros({height, width, channels}, at::kFloat);
        Imf::FrameBuffer buffer;
        for (std::int64_t c = grey ? 2 : 0; c < channels; ++c) {
            buffer.insert(names[c], Imf::Slice::Make(Imf::FLOAT, image.data_ptr<float>() + c, window,
                                                     sizeof(float) * channels, sizeof(float) * channels * width));
        }
        file.setFrameBuffer(buffer);
        file.readPixels(window.min.y, window.max.y);
        if (grey) image.narrow(2, 0, 2).copy_(image.narrow(2, 2, 1).expand({height, width, 2}));
        return image;
    });
}

void write_exr(const std::string& target, const std::string& where, const Tensor& pixels) {
    const std::int64_t height = pixels.size(0), width = pixels.size(1), channels = pixels.size(2);
    const std::vector<const char*> names =
        channels == 1 ? std::vector<const char*>{"Y"} : std::vector<const char*>{"R", "G", "B", "A"};
    try {
        Imf::Header header(static_cast<int>(width), static_cast<int>(height));
        header.compression() = Imf::ZIP_COMPRESSION;
        Imf::FrameBuffer buffer;
        for (std::int64_t c = 0; c < channels; ++c) {
            header.channels().insert(names[c], Imf::Channel(Imf::FLOAT));
            buffer.insert(names[c], Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(pixels.data_ptr<float>() + c),
                                               sizeof(float) * channels, sizeof(float) * channels * width));
        }
        Imf::OutputFile file(target.c_str(), header, 1);
        file.setFrameBuffer(buffer);
        file.writePixels(static_cast<int>(height));
    } catch (const std::exception& error) {
        failure("cannot write {}: {}", where, error.what());
    }
}

}  // namespace fieldgraft::codecs
