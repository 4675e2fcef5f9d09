// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <glm/ext/vector_double3.hpp>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "emit/physics/limits.hpp"
#include "node.hpp"

/// The key table. Every key of every file is one Key<T>, which reads, checks, prints and documents
/// itself. T is the plain struct that the key fills, or a small draft around it.
namespace emit::config {

namespace limits = physics::limits;

/// Documentation of a key.
struct KeySpec {
  std::string name;
  std::string type;
  std::string unit;
  std::string range;
  std::string meaning;
  bool required = false;
  bool open_default = false;  ///< the loader chooses the value where the key is absent
};

/// Interval of a number. It also makes the text for messages and documentation.
struct Range {
  double lo = -std::numeric_limits<double>::infinity();
  double hi = std::numeric_limits<double>::infinity();
  bool lo_open = false;

  [[nodiscard]] bool contains(double value) const noexcept {
    return std::isfinite(value) && (lo_open ? value > lo : value >= lo) && value <= hi;
  }
  [[nodiscard]] std::string to_string() const;
};
[[nodiscard]] inline Range between(double lo, double hi) {
  return {lo, hi, false};
}
[[nodiscard]] inline Range between(const physics::limits::Interval& limits) {
  return between(limits.lo, limits.hi);
}
[[nodiscard]] inline Range above(double lo) {
  return {lo, Range{}.hi, true};
}
[[nodiscard]] inline Range above_to(double lo, double hi) {
  return {lo, hi, true};
}
[[nodiscard]] inline Range at_least(double lo) {
  return {lo, Range{}.hi, false};
}
[[nodiscard]] inline Range any_number() {
  return {};
}

template <class T>
struct Key {
  KeySpec spec;
  std::function<void(T&, const Node&, Diagnostics&)> read;
  /// TOML text of the value. Empty when there is nothing to write.
  std::function<std::optional<std::string>(const T&)> write;
};
template <class T>
using KeyTable = std::vector<Key<T>>;

// Readers of single values. They report a fault and leave `out` as it was.
void read_number(const Node& node, const std::string& name, const Range& range, double& out,
                 Diagnostics& diagnostics);
void read_integer(const Node& node, const std::string& name, std::int64_t lo, std::int64_t hi,
                  std::int64_t& out, Diagnostics& diagnostics);
void read_boolean(const Node& node, const std::string& name, bool& out, Diagnostics& diagnostics);
bool read_text(const Node& node, const std::string& name, std::string& out,
               Diagnostics& diagnostics);
void read_path(const Node& node, const std::string& name, std::filesystem::path& out,
               Diagnostics& diagnostics);
void read_vector(const Node& node, const std::string& name, std::size_t count, double* out,
                 Diagnostics& diagnostics);
void read_instant(const Node& node, const std::string& name, std::int64_t& out,
                  Diagnostics& diagnostics);
/// Reports `node` and returns false unless it is a table, or an array of tables.
bool expect_table(const Node& node, const std::string& name, Diagnostics& diagnostics);
bool expect_table_array(const Node& node, const std::string& name, Diagnostics& diagnostics);

/// Message "unknown key 'x', did you mean 'y'?".
[[nodiscard]] std::string unknown_key_text(std::string_view key,
                                           const std::vector<std::string_view>& known);

/// Shortest decimal number that gives `value` when it is multiplied by `scale`.
[[nodiscard]] std::string unscaled_number(double value, double scale);

/// Reads every member of `table` by `keys`. It reports unknown keys, faulty values and required
/// keys that are missing. The caller reads the keys `also_known` itself. `elsewhere` says where an
/// unknown key belongs; an empty text means nowhere.
template <class T>
void read_table(const Node& table, const KeyTable<T>& keys, T& out, Diagnostics& diagnostics,
                const std::vector<std::string_view>& also_known = {},
                std::string (*elsewhere)(std::string_view key) = nullptr) {
  for (const Member& member : table.members) {
    const Key<T>* found = nullptr;
    for (const Key<T>& key : keys) {
      if (key.spec.name == member.key) {
        found = &key;
        break;
      }
    }
    if (found != nullptr) {
      found->read(out, member.value, diagnostics);
      continue;
    }
    bool known = false;
    for (const std::string_view name : also_known) {
      known = known || name == member.key;
    }
    if (!known) {
      std::vector<std::string_view> names = also_known;
      for (const Key<T>& key : keys) {
        names.push_back(key.spec.name);
      }
      const std::string place = elsewhere != nullptr ? elsewhere(member.key) : std::string();
      diagnostics.add(member.key_at, place.empty()
                                         ? unknown_key_text(member.key, names)
                                         : "unknown key '" + member.key + "', which " + place);
    }
  }
  for (const Key<T>& key : keys) {
    if (key.spec.required && !table.has(key.spec.name)) {
      diagnostics.add(table.at, "key '" + key.spec.name + "' is missing");
    }
  }
}

/// Appends one line "name = value" per key.
template <class T>
void write_table(const T& value, const KeyTable<T>& keys, std::string& out) {
  for (const Key<T>& key : keys) {
    if (const std::optional<std::string> text = key.write(value)) {
      out += key.spec.name + " = " + *text + "\n";
    }
  }
}
/// Text of the keys as an inline table.
template <class T>
std::string inline_table(const T& value, const KeyTable<T>& keys) {
  std::string out = "{";
  for (const Key<T>& key : keys) {
    if (const std::optional<std::string> text = key.write(value)) {
      out += (out.size() > 1 ? ", " : " ") + key.spec.name + " = " + *text;
    }
  }
  return out + " }";
}

/// Function that gives the member a key fills, for const and mutable structs.
#define EMIT_FIELD(member)    \
  [](auto& object) -> auto& { \
    return object.member;     \
  }

template <class T, class Field>
Key<T> number(std::string name, std::string unit, Range range, Field field, std::string meaning,
              double scale = 1.0) {
  Key<T> key;
  key.spec = {name, "float", std::move(unit), range.to_string(), std::move(meaning), false};
  key.read = [name, range, field, scale](T& out, const Node& node, Diagnostics& diagnostics) {
    double value = std::numeric_limits<double>::quiet_NaN();
    read_number(node, name, range, value, diagnostics);
    if (!std::isnan(value)) {
      field(out) = value * scale;
    }
  };
  key.write = [field, scale](const T& in) -> std::optional<std::string> {
    if constexpr (std::is_same_v<std::decay_t<decltype(field(in))>, std::optional<double>>) {
      if (!field(in)) {
        return std::nullopt;
      }
      return unscaled_number(*field(in), scale);
    } else {
      return unscaled_number(field(in), scale);
    }
  };
  return key;
}

/// Key of a time that is kept as int64 ns. `scale_ns` is the unit of the file (1e9 for seconds).
template <class T, class Field>
Key<T> nanoseconds(std::string name, std::string unit, double scale_ns, Range range, Field field,
                   std::string meaning) {
  Key<T> key;
  key.spec = {name, "float", std::move(unit), range.to_string(), std::move(meaning), false};
  key.read = [name, range, field, scale_ns](T& out, const Node& node, Diagnostics& diagnostics) {
    double value = std::numeric_limits<double>::quiet_NaN();
    read_number(node, name, range, value, diagnostics);
    if (!std::isnan(value)) {
      field(out) = std::llround(value * scale_ns);
    }
  };
  key.write = [field, scale_ns](const T& in) -> std::optional<std::string> {
    return toml_number(static_cast<double>(field(in)) / scale_ns);
  };
  return key;
}

template <class T, class Field>
Key<T> integer(std::string name, std::string unit, std::int64_t lo, std::int64_t hi, Field field,
               std::string meaning) {
  Key<T> key;
  key.spec = {name,
              "integer",
              std::move(unit),
              std::to_string(lo) + " .. " + std::to_string(hi),
              std::move(meaning),
              false};
  key.read = [name, lo, hi, field](T& out, const Node& node, Diagnostics& diagnostics) {
    auto& member = field(out);
    auto value = static_cast<std::int64_t>(member);
    read_integer(node, name, lo, hi, value, diagnostics);
    member = static_cast<std::decay_t<decltype(member)>>(value);
  };
  key.write = [field](const T& in) -> std::optional<std::string> {
    return std::to_string(field(in));
  };
  return key;
}

/// Key of an integer whose range stands in the table of limits.
template <class T, class Field>
Key<T> integer(std::string name, std::string unit, const physics::limits::Count& limits,
               Field field, std::string meaning) {
  return integer<T>(std::move(name), std::move(unit), std::int64_t{limits.lo},
                    std::int64_t{limits.hi}, field, std::move(meaning));
}

template <class T, class Field>
Key<T> boolean(std::string name, Field field, std::string meaning) {
  Key<T> key;
  key.spec = {name, "boolean", "", "true, false", std::move(meaning), false};
  key.read = [name, field](T& out, const Node& node, Diagnostics& diagnostics) {
    read_boolean(node, name, field(out), diagnostics);
  };
  key.write = [field](const T& in) -> std::optional<std::string> {
    return field(in) ? "true" : "false";
  };
  return key;
}

template <class T, class Field>
Key<T> text(std::string name, Field field, std::string meaning) {
  Key<T> key;
  key.spec = {name, "string", "", "", std::move(meaning), false};
  key.read = [name, field](T& out, const Node& node, Diagnostics& diagnostics) {
    read_text(node, name, field(out), diagnostics);
  };
  key.write = [field](const T& in) -> std::optional<std::string> { return toml_string(field(in)); };
  return key;
}

/// Key with one of several words. V is the value of a word: an enumerator, or the word itself.
template <class T, class Field, class V>
Key<T> choice(std::string name, std::vector<std::pair<std::string, V>> options, Field field,
              std::string meaning) {
  std::string listed;
  for (const auto& option : options) {
    listed += (listed.empty() ? "" : ", ") + option.first;
  }
  Key<T> key;
  key.spec = {name, "string", "", listed, std::move(meaning), false};
  key.read = [name, options, listed, field](T& out, const Node& node, Diagnostics& diagnostics) {
    std::string word;
    if (!read_text(node, name, word, diagnostics)) {
      return;
    }
    for (const auto& option : options) {
      if (option.first == word) {
        field(out) = option.second;
        return;
      }
    }
    diagnostics.add(node.at, "'" + name + "' is '" + word + "', must be one of: " + listed);
  };
  key.write = [options, field](const T& in) -> std::optional<std::string> {
    for (const auto& option : options) {
      if (option.second == field(in)) {
        return toml_string(option.first);
      }
    }
    return std::nullopt;
  };
  return key;
}

template <class T, class Field>
Key<T> path(std::string name, Field field, std::string meaning) {
  Key<T> key;
  key.spec = {name, "path", "", "", std::move(meaning), false};
  key.read = [name, field](T& out, const Node& node, Diagnostics& diagnostics) {
    read_path(node, name, field(out), diagnostics);
  };
  key.write = [field](const T& in) -> std::optional<std::string> {
    if (field(in).empty()) {
      return std::nullopt;
    }
    return toml_string(field(in).string());
  };
  return key;
}

/// Key with its own reader and writer.
template <class T>
Key<T> custom(KeySpec spec, std::function<void(T&, const Node&, Diagnostics&)> read,
              std::function<std::optional<std::string>(const T&)> write) {
  return {std::move(spec), std::move(read), std::move(write)};
}

/// Key that is written only where `present` is true.
template <class T, class Present>
Key<T> written_if(Present present, Key<T> key) {
  key.write = [present, inner = std::move(key.write)](const T& in) -> std::optional<std::string> {
    if (!present(in)) {
      return std::nullopt;
    }
    return inner(in);
  };
  return key;
}

/// Key whose value the loader chooses where it is absent; its meaning says how.
template <class T>
Key<T> open_default(Key<T> key) {
  key.spec.open_default = true;
  return key;
}

template <class T>
Key<T> required(Key<T> key) {
  key.spec.required = true;
  return key;
}

}  // namespace emit::config
