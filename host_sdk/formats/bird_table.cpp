#include "host_sdk/formats/bird_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "host_sdk/formats/bird_metadata.h"
#include "host_sdk/formats/counted_text.h"

namespace scatter::formats {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kDeepest = 64;
constexpr std::size_t kMostStates = 64;
constexpr std::size_t kMostMetadata = 4 << 20;  // Bytes.
constexpr std::size_t kMostColumns = 256;
/// Where our writer puts the metadata of a grid.
constexpr std::string_view kOurs = "metadata.adhoc_section.scatter.";

/// Variables that the reader understands; others are skipped.
constexpr std::array<std::string_view, 14> kKnown{
    "theta_i", "phi_i",        "theta_r",      "phi_r",       "theta_v",        "phi_v",          "BRDF",
    "uBRDF",   "wavelength_i", "wavelength_r", "wavelengths", "polarization_i", "polarization_r", "pol"};
/// Of the variables of others' making, only our writer's.
constexpr std::string_view kOurVariables = "scatter_";

bool known(std::string_view variable) {
  return std::ranges::find(kKnown, variable) != kKnown.end();
}

/// Events of nlohmann's parser into columns; nothing of the document is kept beside.
class Reader final : public nlohmann::json_sax<Json> {
 public:
  Reader(std::string_view text, std::string_view name) : name_(name), start_(text.data()) {}

  bool parse(const char* first, const char* last) {
    reached_ = first;
    return Json::sax_parse(CountedChar(first, &reached_), CountedChar(last, &reached_), this);
  }

  bool null() override { return scalar_text("null"); }
  bool boolean(bool value) override { return scalar_text(value ? "true" : "false"); }
  bool number_integer(number_integer_t value) override { return number(static_cast<double>(value)); }
  bool number_unsigned(number_unsigned_t value) override { return number(static_cast<double>(value)); }
  bool number_float(number_float_t value, const string_t& /*text*/) override { return number(value); }
  bool string(string_t& value) override {
    if (value_depth_ == 0 || levels_.size() != value_depth_) {
      return scalar_text(value);
    }
    return add_state(value);
  }
  bool binary(binary_t& /*value*/) override { return refuse("binary data"); }

  bool start_object(std::size_t /*size*/) override {
    next();
    if (value_depth_ != 0) {
      return refuse("an object among the values");
    }
    is_ours_ = is_ours_ || (levels_.size() == 3 && path() + "." == kOurs);
    return push({.is_object = true, .keys = {}, .key = {}, .index = 0});
  }
  bool key(string_t& key) override {
    Level& level = levels_.back();
    level.key = key;
    if (levels_.size() == 2 && levels_[0].key == "metadata") {
      metadata_check_.see_key(key);
    }
    // Metadata may be long; their paths are checked one by one where they are kept.
    if (!in_metadata() && (!level.keys.insert(key).second || level.keys.size() > kMostColumns)) {
      return refuse("the same key twice in one object, or more than 256 keys");
    }
    return true;
  }
  bool end_object() override {
    levels_.pop_back();
    return true;
  }
  bool start_array(std::size_t /*size*/) override {
    next();
    if (!push({.is_object = false, .keys = {}, .key = {}, .index = 0})) {
      return false;
    }
    if (value_depth_ == 0) {
      begin_values();
    } else if (levels_.size() == value_depth_ + 1) {
      row_.clear();
    } else if (levels_.size() > value_depth_ + 1) {
      return refuse("a list in a list of values");
    }
    return true;
  }
  bool end_array() override {
    const bool ends_row = value_depth_ != 0 && levels_.size() == value_depth_ + 1;
    if (value_depth_ != 0 && levels_.size() == value_depth_) {
      value_depth_ = 0;
      column_ = nullptr;
    }
    levels_.pop_back();
    return !ends_row || add_row();
  }
  bool parse_error(std::size_t /*position*/, const std::string& /*token*/,
                   const nlohmann::detail::exception& exception) override {
    std::string what = exception.what();
    // "[json.exception.parse_error.101] parse error at line 1, column 5: syntax error ...".
    if (const std::size_t at = what.find("] "); at != std::string::npos) {
      what.erase(0, at + 2);
    }
    std::erase_if(what, [](char c) { return c < ' ' || c > '~'; });
    error_ = fmt::format("byte {}: {}", byte(), what.substr(0, 200));
    return false;
  }

  Result<BirdTable> finish(bool parsed) {
    if (!parsed) {
      return bad(error_);
    }
    if (!variables_.empty() || !rows_of_b_.empty()) {
      if (Status status = name_columns_of_b(); !status) {
        return std::unexpected(status.error());
      }
    } else if (table_.columns.contains("data")) {
      if (Status status = expand_c(); !status) {
        return std::unexpected(status.error());
      }
    } else if (table_.columns.contains("BRDF")) {
      metadata_check_.warn(printable(type()), table_.warnings);
    }
    if (BirdMetadataCheck::is_other_quantity(type())) {
      return fail(ErrorCode::kUnimplemented,
                  fmt::format("{}: metadata.type is '{}', expected BRDF", name_, printable(type())),
                  "correct the type if the values are a BRDF; BiRD has no place for others");
    }
    if (is_ours_) {
      // The rest was made of them by our writer.
      table_.metadata = std::move(ours_);
    }
    if (!table_.columns.contains("BRDF")) {
      return fail(ErrorCode::kInvalidArgument,
                  fmt::format("{}: JSON without BRDF values, no BiRD file", name_),
                  "check that it is a BRDF of the BiRD project");
    }
    const std::size_t rows = table_.columns["BRDF"].size();
    for (const auto& [key, column] : table_.columns) {
      if (column.size() != rows) {
        return bad(fmt::format("data.{}: {} values, expected the {} of BRDF (list at byte {})",
                               printable(key), column.size(), rows, column.byte));
      }
    }
    return std::move(table_);
  }

 private:
  struct Level {
    bool is_object = false;
    std::set<std::string> keys;
    std::string key;
    std::size_t index = 0;  ///< Of the next element.
  };
  enum class Kind : std::uint8_t { kColumn, kRowsOfB, kRowsOfC };

  static std::string printable(std::string_view text) {
    std::string out(text.substr(0, 60));
    std::ranges::replace_if(out, [](char c) { return c < ' ' || c > '~'; }, '?');
    return out;
  }
  [[nodiscard]] std::unexpected<Error> bad(std::string_view what) const {
    return fail(ErrorCode::kDataLoss, fmt::format("{}: {}", name_, what),
                "export the file again or correct this place");
  }
  /// How many bytes of the file are read.
  [[nodiscard]] std::size_t byte() const noexcept { return static_cast<std::size_t>(reached_ - start_); }
  [[nodiscard]] std::string_view type() const {
    const auto it = table_.metadata.find("bird.type");
    return it == table_.metadata.end() ? std::string_view() : std::string_view(it->second);
  }
  /// Ends the parsing.
  bool refuse(std::string_view what) {
    if (value_depth_ != 0) {
      levels_.resize(value_depth_ - 1);  // The list's own name; its length says where in it.
    }
    const std::string place =
        column_ != nullptr ? fmt::format(" after {} values", column_->size()) : std::string();
    error_ = fmt::format("byte {}: {}{}: {}", byte(), printable(path()), place, what);
    return false;
  }
  bool push(Level level) {
    levels_.push_back(std::move(level));
    return levels_.size() <= kDeepest || refuse("nested deeper than 64 levels");
  }
  /// An element of an array begins.
  void next() {
    if (!levels_.empty() && !levels_.back().is_object) {
      levels_.back().key = std::to_string(levels_.back().index++);
    }
  }
  [[nodiscard]] bool in_metadata() const {
    return !levels_.empty() && (levels_[0].key == "metadata" || levels_[0].key == "head");
  }
  /// "data.theta_i.values".
  [[nodiscard]] std::string path() const {
    std::string out;
    for (const Level& level : levels_) {
      out += out.empty() || level.key.empty() ? "" : ".";
      out += level.key;
    }
    return out;
  }

  /// The array that has just begun may be one of values.
  void begin_values() {
    const std::size_t depth = levels_.size() - 1;  // Keys above it.
    if (depth < 2 || levels_[0].key != "data" || !levels_[1].is_object) {
      return;
    }
    const std::string& name = levels_[1].key;
    const bool of_variable = depth == 3 && levels_[2].is_object && levels_[2].key == "values";
    const bool adhoc =
        depth == 4 && name == "adhoc_variables" && levels_[3].is_object && levels_[3].key == "values";
    if (depth == 2 && name == "values") {
      kind_ = Kind::kRowsOfB;
      byte_of_b_ = byte();
    } else if (depth == 2 && name == "data") {
      kind_ = Kind::kRowsOfC;
      column_ = &table_.columns["data"];
    } else if ((depth == 2 || of_variable) && known(name)) {
      kind_ = Kind::kColumn;
      column_ = &table_.columns[name];
    } else if (adhoc && levels_[2].key.starts_with(kOurVariables)) {
      kind_ = Kind::kColumn;
      column_ = &table_.columns[levels_[2].key];
    } else {
      return;
    }
    if (kind_ != Kind::kRowsOfB) {
      std::string place;
      for (std::size_t k = 0; k < depth; ++k) {
        place += (k == 0 ? "" : ".") + levels_[k].key;
      }
      column_->path = std::move(place);
      column_->byte = byte();
    }
    value_depth_ = levels_.size();
  }

  bool number(double value) {
    if (value_depth_ == 0) {
      return scalar_text(fmt::format("{}", value));
    }
    if (levels_.size() == value_depth_ + 1) {
      if (kind_ == Kind::kRowsOfC) {
        column_->numbers.push_back(value);
        row_count_ += 1;
      } else {
        row_.emplace_back(value, std::string());
      }
      return true;
    }
    if (kind_ != Kind::kColumn) {
      return refuse("a number, expected a row of values");
    }
    column_->numbers.push_back(value);
    return column_->states.empty() || refuse("numbers and words in one list");
  }

  bool add_state(const std::string& text) {
    if (levels_.size() == value_depth_ + 1 && kind_ == Kind::kRowsOfB) {
      row_.emplace_back(0.0, text);
      return true;
    }
    return kind_ == Kind::kColumn ? push_state(*column_, text) : refuse("a word, expected a number");
  }
  bool push_state(BirdColumn& column, const std::string& text) {
    auto it = std::ranges::find(table_.states, text);
    if (it == table_.states.end()) {
      if (table_.states.size() == kMostStates || text.size() > 200) {
        return refuse("more than 64 different words among the values");
      }
      it = table_.states.insert(it, text);
    }
    column.states.push_back(static_cast<std::uint8_t>(it - table_.states.begin()));
    return column.numbers.empty() || refuse("numbers and words in one list");
  }

  /// The end of a list among the values: a Stokes vector, or a row of B or C.
  bool add_row() {
    if (kind_ == Kind::kRowsOfC) {
      rows_of_c_.push_back(std::exchange(row_count_, 0));
      return true;
    }
    if (kind_ == Kind::kColumn) {
      std::string text;
      for (const auto& [value, word] : row_) {
        text += fmt::format("{}{:g}", text.empty() ? "" : " ", value);
      }
      return push_state(*column_, text);
    }
    if (rows_of_b_.empty()) {
      if (row_.empty() || row_.size() > kMostColumns) {
        return refuse("a row of no values, or of more than 256");
      }
      rows_of_b_.resize(row_.size());
    }
    if (row_.size() != rows_of_b_.size()) {
      return refuse(fmt::format("{} values in a row, expected {}", row_.size(), rows_of_b_.size()));
    }
    for (std::size_t k = 0; k < row_.size(); ++k) {
      BirdColumn& column = rows_of_b_[k];
      if (row_[k].second.empty()) {
        column.numbers.push_back(row_[k].first);
        if (!column.states.empty()) {
          return refuse("numbers and words in one column");
        }
      } else if (!push_state(column, row_[k].second)) {
        return false;
      }
    }
    return true;
  }

  /// A value that is no element of a column: a unit, or something to remember.
  bool scalar_text(const std::string& text) {
    next();
    if (value_depth_ != 0 && (levels_.size() != value_depth_ + 1 || kind_ != Kind::kRowsOfB)) {
      return refuse(fmt::format("'{}' among the values", printable(text)));
    }
    if (value_depth_ != 0) {
      row_.emplace_back(0.0, text);
      return true;
    }
    if (levels_.size() >= 3 && levels_[0].key == "data") {
      return data_scalar(text);
    }
    if (levels_.size() == 2 && levels_[0].key == "data" && levels_[1].key == "pol") {
      pol_of_all_ = text;
      return true;
    }
    return in_metadata() ? keep(text) : true;
  }

  bool data_scalar(const std::string& text) {
    const std::string& name = levels_[1].key;
    const std::string& field = levels_.back().key;
    if (name == "variables" && !levels_[2].is_object && levels_.size() == 3) {
      return true;
    }
    if (name == "variables" && levels_.size() == 4) {
      const std::size_t index = levels_[2].index - 1;
      if (index >= kMostColumns) {
        return refuse("more than 256 variables");
      }
      variables_.resize(std::max(variables_.size(), index + 1));
      (field == "name"   ? variables_[index].first
       : field == "unit" ? variables_[index].second
                         : ignored_) = text;
    } else if (field == "unit" && levels_.size() == 3 && known(name)) {
      table_.columns[name].unit = text;
    }
    return true;
  }

  bool keep(const std::string& text) {
    std::string key = path();
    metadata_size_ += key.size() + text.size();
    if (metadata_size_ > kMostMetadata) {
      return refuse("more than 4 MB of metadata");
    }
    if (key.starts_with(kOurs)) {
      return ours_.emplace(key.substr(kOurs.size()), text).second || refuse("is there twice");
    }
    key = "bird." + (key.starts_with("metadata.") ? key.substr(9) : key);
    return table_.metadata.emplace(key, text).second || refuse("is there twice");
  }

  Status name_columns_of_b() {
    if (variables_.size() != rows_of_b_.size()) {
      return bad(fmt::format("data.variables: {} variables, but rows of {} values", variables_.size(),
                             rows_of_b_.size()));
    }
    for (std::size_t k = 0; k < variables_.size(); ++k) {
      rows_of_b_[k].unit = variables_[k].second;
      rows_of_b_[k].path = "data.values";
      rows_of_b_[k].variable = printable(variables_[k].first);
      rows_of_b_[k].byte = byte_of_b_;
      if (known(variables_[k].first) &&
          !table_.columns.emplace(variables_[k].first, std::move(rows_of_b_[k])).second) {
        return bad(fmt::format("data.variables: '{}' is there twice", printable(variables_[k].first)));
      }
    }
    return {};
  }

  /// C: one row per wavelength and sample.
  Status expand_c() {
    auto& columns = table_.columns;
    BirdColumn values = std::move(columns["data"]);
    columns.erase("data");
    BirdColumn wavelengths = std::move(columns["wavelengths"]);
    columns.erase("wavelengths");
    const std::size_t samples = columns["theta_i"].numbers.size();
    if (rows_of_c_.size() != wavelengths.numbers.size() || rows_of_c_.empty() || samples == 0 ||
        std::ranges::any_of(rows_of_c_, [&](std::size_t n) { return n != samples; })) {
      return bad(fmt::format("data.data: {} rows, expected one per wavelength ({}) with {} samples each",
                             rows_of_c_.size(), wavelengths.numbers.size(), samples));
    }
    std::map<std::string, BirdColumn> out;
    for (const auto& [from, to] : {std::pair{"theta_i", "theta_i"},
                                   {"phi_i", "phi_i"},
                                   {"theta_v", "theta_r"},
                                   {"phi_v", "phi_r"},
                                   {"theta_r", "theta_r"},
                                   {"phi_r", "phi_r"},
                                   {"pol", "polarization_i"}}) {
      const auto it = columns.find(from);
      if (it == columns.end()) {
        continue;
      }
      if (it->second.size() != samples) {
        return bad(fmt::format("data.{}: {} values, expected {}", from, it->second.size(), samples));
      }
      BirdColumn& column = out[to];
      column.unit = it->second.numbers.empty() ? "" : "deg";
      column.path = it->second.path;
      column.byte = it->second.byte;
      column.count = samples;
      for (std::size_t w = 0; w < rows_of_c_.size(); ++w) {
        column.numbers.insert(column.numbers.end(), it->second.numbers.begin(), it->second.numbers.end());
        column.states.insert(column.states.end(), it->second.states.begin(), it->second.states.end());
      }
      columns.erase(it);
    }
    BirdColumn& wavelength = out["wavelength_i"];
    wavelength.unit = "nm";
    wavelength.path = wavelengths.path;
    wavelength.byte = wavelengths.byte;
    wavelength.each = samples;
    for (const double nm : wavelengths.numbers) {
      wavelength.numbers.insert(wavelength.numbers.end(), samples, nm);
    }
    values.unit = "1/sr";
    out["BRDF"] = std::move(values);
    if (!pol_of_all_.empty()) {
      table_.metadata.emplace("bird.pol", pol_of_all_);
    }
    columns = std::move(out);
    return {};
  }

  std::string_view name_;
  const char* start_;
  const char* reached_ = nullptr;
  std::string error_ = "no value";
  BirdMetadataCheck metadata_check_;
  std::size_t byte_of_b_ = 0;
  BirdTable table_;
  std::vector<Level> levels_;
  std::size_t value_depth_ = 0;  ///< Levels at the elements of a list of values; 0: in none.
  Kind kind_ = Kind::kColumn;
  BirdColumn* column_ = nullptr;  ///< Map nodes stay where they are.
  std::vector<std::pair<double, std::string>> row_;
  std::vector<std::pair<std::string, std::string>> variables_;  ///< B: name and unit.
  std::string ignored_;
  bool is_ours_ = false;
  std::map<std::string, std::string> ours_;
  std::vector<BirdColumn> rows_of_b_;
  std::vector<std::size_t> rows_of_c_;
  std::size_t row_count_ = 0;
  std::string pol_of_all_;
  std::size_t metadata_size_ = 0;
};

}  // namespace

std::string BirdColumn::place(std::size_t row) const {
  const std::size_t index = count == 0 ? row / each : row / each % count;
  return fmt::format("{}[{}]{}{} (list at byte {})", path, index, variable.empty() ? "" : " ", variable,
                     byte);
}

Result<BirdTable> read_bird_table(std::string_view text, std::string_view name) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  const std::size_t first = text.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0;
  Reader reader(text, name);
  const bool parsed = reader.parse(text.data() + first, text.data() + text.size());
  return reader.finish(parsed);
}

}  // namespace scatter::formats
