// A scene: cameras, images and the box that holds what is seen, all in model coordinates.
//
// Read from NeRF-synthetic (transforms_train/val/test.json), nerfstudio or instant-ngp (transforms.json) files; images
// PNG, JPEG or EXR. Where the model coordinates come from (`frame` takes the user's world there):
//   NeRF-synthetic  the file's own world, box ±1.5, frame the identity.
//   nerfstudio      its dataparser_transforms.json if there is one beside the file; else the cameras' mean up becomes
//   +Z, the
//                   point the cameras look at becomes 0, and the scale is such that the box is ±1.5: images with alpha:
//                   the box just holds what the cameras see around that point; others: all cameras are within ±1 of it.
//   instant-ngp     no turn; centre (½ − offset)/scale; half side aabb_scale/(2·scale), but no more than the rule
//   above.
// The user's world is the one before a file's applied_transform and applied_scale.
//
// Splits: one file a split, or the file's own {train,val,test}_filenames, or else, frames sorted by file name, every
// 8th (0, 8, 16 …) is a test view once there are at least 8.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/camera.h"
#include "core/scene/frame.h"

namespace fieldgraft {

struct Bounds {
    Vec3 min{-1.5, -1.5, -1.5};
    Vec3 max{1.5, 1.5, 1.5};
    bool operator==(const Bounds&) const = default;
};

struct View {
    Camera camera;  // its name is the image's file name without folder and extension
    std::filesystem::path image;
    std::filesystem::path mask;  // empty: none. Black pixels are to be ignored.
    std::string split;           // train, val or test
    std::size_t index = 0;       // its place in Scene::views()
};

struct SceneOptions {
    std::vector<std::string> splits;  // read only these; empty: all there are
    double downscale = 1;             // ≥ 1: images are reduced by this factor
    std::optional<Bounds> box;        // in the user's world, instead of the file's
};

class Scene {
  public:
    // `path` is the folder or one of its transforms*.json. All images must exist and have the sizes the file says; they
    // are decoded later. Throws InputError: one line that says what, where, and what would be right.
    static Scene load(const std::filesystem::path& path, const SceneOptions& options = {});
    // A scene out of memory: images H×W×3 or H×W×4 in [0, 1], one a camera, all of the split "train" unless told
    // otherwise.
    static Scene from_images(std::vector<Camera> cameras, const std::vector<Tensor>& images, const Bounds& bounds = {},
                             const std::vector<std::string>& splits = {});

    const std::string& name() const { return name_; }
    const std::vector<View>& views() const { return views_; }
    std::vector<View> views(const std::string& split) const;
    // The views to measure on while training: val, else test, else every 8th of train.
    std::vector<View> validation_views() const;
    std::vector<Camera> cameras(const std::string& split) const;
    // By camera name or file name, within a split first if one is given; throws InputError naming some that there are.
    const View& view(const std::string& name, const std::string& split = "") const;

    // H×W×C uint8, C = 4 if has_alpha() else 3, straight alpha, sRGB values; EXR (linear, premultiplied) is converted.
    // Decoded once, then kept. May be called from several threads.
    Tensor pixels(const View& view) const;
    // The same, decoded again and not kept.
    Tensor decoded(const View& view) const;
    // The same as float32 in [0, 1].
    Tensor image(const View& view) const;
    // H×W bool, false where the view's mask says ignore; undefined if it has no mask.
    Tensor mask(const View& view) const;
    Tensor decoded_mask(const View& view) const;  // not kept

    bool has_alpha() const { return has_alpha_; }
    const Bounds& bounds() const { return bounds_; }
    const Frame& frame() const { return frame_; }
    Vec3 up() const { return {0, 0, 1}; }
    // What the training cameras look at, and the range of their distances from it.
    const Vec3& centre() const { return centre_; }
    const std::array<double, 2>& radius_range() const { return radius_range_; }
    bool forward_facing() const { return forward_facing_; }
    // Oddities that were read all the same, one line each.
    const std::vector<std::string>& warnings() const { return warnings_; }

  private:
    struct Cache;
    Scene();
    void finish();

    std::string name_;
    std::vector<View> views_;
    Bounds bounds_;
    Frame frame_;
    Vec3 centre_{0, 0, 0};
    std::array<double, 2> radius_range_{0, 0};
    bool has_alpha_ = false;
    bool forward_facing_ = false;
    double downscale_ = 1;
    std::vector<std::string> warnings_;
    std::shared_ptr<Cache> cache_;
};

}  // namespace fieldgraft
