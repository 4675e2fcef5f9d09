// SPDX-License-Identifier: Apache-2.0
#include "tool/scenes/material_guess.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

namespace emit::tool {
namespace {

/// Words in names of materials, as modellers call them, and the material of the library.
constexpr auto kWords = std::to_array<std::pair<std::string_view, std::string_view>>({
    {"asphalt", "asphalt"},
    {"tarmac", "asphalt"},
    {"road", "asphalt"},
    {"street", "asphalt"},
    {"bitumen", "asphalt"},
    {"pavement", "concrete_pavement"},
    {"concrete", "concrete"},
    {"cement", "concrete"},
    {"runway", "concrete_pavement"},
    {"grass", "grass"},
    {"lawn", "grass"},
    {"meadow", "grass"},
    {"leaf", "foliage"},
    {"leaves", "foliage"},
    {"foliage", "foliage"},
    {"tree", "foliage"},
    {"bush", "foliage"},
    {"hedge", "foliage"},
    {"soil", "soil"},
    {"dirt", "soil"},
    {"earth", "soil"},
    {"mud", "soil"},
    {"sand", "sand"},
    {"beach", "sand"},
    {"gravel", "gravel"},
    {"stone", "stone"},
    {"rock", "stone"},
    {"marble", "stone"},
    {"granite", "stone"},
    {"brick", "brick"},
    {"roof", "roof_concrete"},
    {"wood", "wood"},
    {"timber", "wood"},
    {"plank", "wood"},
    {"bark", "wood"},
    {"trunk", "wood"},
    {"rubber", "rubber"},
    {"tire", "rubber"},
    {"tyre", "rubber"},
    {"track", "rubber"},
    {"plastic", "rubber"},
    {"water", "water"},
    {"sea", "water"},
    {"lake", "water"},
    {"snow", "snow"},
    {"ice", "snow"},
    {"fabric", "fabric"},
    {"cloth", "fabric"},
    {"canvas", "fabric"},
    {"tarp", "fabric"},
    {"seat", "fabric"},
    {"leather", "fabric"},
    {"glass", "glass"},
    {"window", "glass"},
    {"windscreen", "glass"},
    {"windshield", "glass"},
    {"aluminium", "aluminium"},
    {"aluminum", "aluminium"},
    {"aircraft", "aircraft_skin"},
    {"fuselage", "aircraft_skin"},
    {"wing", "aircraft_skin"},
    {"exhaust", "exhaust_hot"},
    {"muffler", "exhaust_hot"},
    {"nozzle", "nozzle_hot"},
    {"engine", "engine_warm"},
    {"radiator", "engine_warm"},
    {"bright_metal", "steel"},
    {"polished", "steel"},
    {"chrome", "steel"},
    {"steel", "steel"},
    {"iron", "steel"},
    {"rim", "steel"},
    {"metal", "painted_metal"},
    {"paint", "painted_metal"},
    {"chassis", "painted_metal"},
    {"body", "painted_metal"},
    {"hull", "painted_metal"},
});

std::string lower(std::string_view text) {
  std::string out;
  for (const char c : text) {
    out += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return out;
}

/// True where `word` stands in `name` as a word of its own. A word of five letters and more counts
/// inside others too, as in "frontwindscreen".
bool stands_in(const std::string& name, std::string_view word) {
  constexpr std::size_t kLong = 5;
  for (std::size_t at = name.find(word); at != std::string::npos; at = name.find(word, at + 1)) {
    const std::size_t end = at + word.size();
    const auto is_letter = [&](std::size_t i) {
      return i < name.size() && std::isalpha(static_cast<unsigned char>(name[i])) != 0;
    };
    const bool plural = end < name.size() && name[end] == 's' && !is_letter(end + 1);
    const bool own = (at == 0 || !is_letter(at - 1)) && (!is_letter(end) || plural);
    if (own || word.size() >= kLong) return true;
  }
  return false;
}

/// Separates words that only a capital separates: CarPaint becomes Car_Paint.
std::string separated(std::string_view name) {
  std::string out;
  for (std::size_t i = 0; i < name.size(); ++i) {
    const bool starts = i > 0 && std::isupper(static_cast<unsigned char>(name[i])) != 0 &&
                        std::islower(static_cast<unsigned char>(name[i - 1])) != 0;
    if (starts) out += '_';
    out += name[i];
  }
  return out;
}

}  // namespace

MaterialGuess guess_material(std::string_view gltf_material,
                             std::span<const scene::Material> library) {
  const auto has = [&](std::string_view name) {
    return std::ranges::any_of(library, [&](const auto& each) { return each.name == name; });
  };
  if (has(gltf_material)) {
    return {std::string(gltf_material), std::string(gltf_material), true};
  }
  const std::string name = lower(separated(gltf_material));
  MaterialGuess guess;
  const auto offer = [&](std::string_view word, std::string_view material) {
    if (word.size() <= guess.word.size() || !stands_in(name, word) || !has(material)) return;
    guess = {std::string(material), std::string(word)};
  };
  for (const auto& [word, material] : kWords) offer(word, material);
  // Names of the library count as words too.
  for (const scene::Material& material : library) offer(material.name, material.name);
  return guess;
}

}  // namespace emit::tool
