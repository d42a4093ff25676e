#include "core/profile/pictures.h"

#include "core/base/progress.h"
#include "core/render/image_metrics.h"

namespace fieldgraft {

Tensor picture_of(const FieldGeometry& geometry, const Tensor& color, const Tensor& alpha, const Camera& camera) {
    return over_background_color(color, alpha, geometry.background).clamp(0, 1).view({camera.height, camera.width, 3});
}

TimedPictures draw_views(const RadianceField& field, const EditStack& stack, const std::vector<Camera>& cameras,
                         const BlendedOptions& options, double scale) {
    TimedPictures out;
    for (const Camera& camera : cameras) {
        const Camera view = scaled(camera, scale);
        const Rays rays = rays_of_view(view);
        const Stopwatch watch;
        const BlendedRays drawn = render_blended_rays(field, stack, {rays.origins, rays.directions}, options);
        out.seconds += watch.seconds() / static_cast<double>(cameras.size());
        out.pictures.push_back(picture_of(field.geometry(), drawn.color, drawn.alpha, view));
    }
    return out;
}

double mean_psnr(const std::vector<Tensor>& pictures, const std::vector<Tensor>& expected) {
    double sum = 0;
    for (std::size_t i = 0; i < pictures.size(); ++i) sum += psnr(pictures[i], expected[i]);
    return sum / static_cast<double>(pictures.size());
}

}  // namespace fieldgraft
