// SPDX-License-Identifier: Apache-2.0
#include "cut_outs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "gltf_image.hpp"

namespace emit::scene {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Reads what cuts out the surfaces of a material; nothing where it is not of `alphaMode` MASK. A
/// mask of one texel stands for a material without an image.
Result<std::optional<AlphaMask>> read_alpha_mask(const GltfFile& file, std::uint32_t material) {
  const tinygltf::Material& source = file.model.materials[material];
  if (source.alphaMode != "MASK") return std::optional<AlphaMask>{};
  const auto& pbr = source.pbrMetallicRoughness;
  const double factor = pbr.baseColorFactor.size() == 4 ? pbr.baseColorFactor[3] : 1.0;
  AlphaMask mask;
  mask.cutoff = static_cast<float>(source.alphaCutoff);
  if (pbr.baseColorTexture.index < 0) {
    mask.frame.width_px = mask.frame.height_px = 1;
    mask.alpha = {static_cast<float>(factor)};
    return std::optional<AlphaMask>(std::move(mask));
  }
  Result<TextureUse> use = texture_use(file, pbr.baseColorTexture);
  if (!use) return tl::unexpected(std::move(use.error()));
  Result<DecodedImage> image = read_image(file, use->image);
  if (!image) return tl::unexpected(std::move(image.error()));
  mask.frame = use->frame;
  mask.frame.width_px = image->width_px;
  mask.frame.height_px = image->height_px;
  mask.alpha = std::move(image->opacity);
  for (float& alpha : mask.alpha) alpha = static_cast<float>(alpha * factor);
  mask.one_colour = true;
  for (std::size_t i = 4; i < image->rgba.size() && mask.one_colour; i += 4) {
    mask.one_colour = std::memcmp(image->rgba.data(), image->rgba.data() + i, 3) == 0;
  }
  return std::optional<AlphaMask>(std::move(mask));
}

}  // namespace

CutOut* CutOuts::mask(std::uint32_t material, std::vector<std::string>& warnings) {
  if (material >= file_.model.materials.size()) return nullptr;
  const auto [entry, is_new] = masks_.try_emplace(material);
  std::optional<CutOut>& cut_out = entry->second;
  if (is_new) {
    auto mask = read_alpha_mask(file_, material);
    if (!mask) {
      warnings.push_back(fmt::format(
          "{}: {}: what alphaMode MASK cuts out is taken as solid: {}", file_.name,
          element("material", static_cast<int>(material), file_.model.materials[material].name),
          mask.error().text));
    } else if (*mask) {
      cut_out.emplace(std::move(**mask));
    }
  }
  return cut_out ? &*cut_out : nullptr;
}

bool CutOuts::is_outline(std::uint32_t material) const {
  const auto found = masks_.find(material);
  return found != masks_.end() && found->second && found->second->mask()->one_colour;
}

Result<void> CutOuts::add_regions(std::uint32_t material, const MaterialImage& image,
                                  std::uint32_t first_material) {
  const tinygltf::TextureInfo& info =
      file_.model.materials[material].pbrMetallicRoughness.baseColorTexture;
  // An image of the scenario lies on the surface as that of the file does.
  TextureUse use;
  if (info.index >= 0) {
    Result<TextureUse> found = texture_use(file_, info);
    if (found) {
      use = *found;
    } else if (image.image.empty()) {
      return tl::unexpected(std::move(found.error()));
    }
  } else if (image.image.empty()) {
    return make_error(ErrorCode::parse,
                      fmt::format("{}: it has no base colour texture, and 'image' names none",
                                  element("material", static_cast<int>(material),
                                          file_.model.materials[material].name)));
  }
  const Result<DecodedImage> pixels =
      image.image.empty() ? read_image(file_, use.image) : read_image(image.image);
  if (!pixels) return tl::unexpected(pixels.error());
  use.frame.width_px = pixels->width_px;
  use.frame.height_px = pixels->height_px;
  std::vector<Rgb> legend;
  for (const MaterialColour& colour : image.legend) legend.push_back(colour.rgb);
  RegionImage regions = regions_by_colour(use.frame, pixels->rgba, legend);
  drop_small_patches(regions, image.smallest_patch_px);
  regions_.insert_or_assign(
      material, RegionCut{CutOut(std::move(regions)), first_material,
                          image.image.empty() ? file_.name : image.image.filename().string()});
  return {};
}

RegionCut* CutOuts::regions(std::uint32_t material) {
  const auto found = regions_.find(material);
  return found == regions_.end() ? nullptr : &found->second;
}

}  // namespace emit::scene
