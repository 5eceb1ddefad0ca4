// Damage done to every text format: one error with its place, or a whole BRDF; never anything else.
#include <array>
#include <catch2/catch.hpp>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "host_sdk/formats/file_bytes.h"
#include "host_sdk/formats/open_brdf.h"
#include "host_sdk/formats/save_brdf.h"
#include "host_sdk/reflectance/models/model_spec.h"
#include "tests/unit/formats/real_data.h"

using namespace scatter;
using namespace scatter::formats;
using namespace scatter::reflectance;

namespace {

/// A small file of each kind.
struct TextFile {
  const char* word;
  std::string text;
  std::vector<const char*> keywords;  ///< Each must be there once.
};

std::vector<TextFile> text_files() {
  std::vector<TextFile> out{
      {"zemax",
       "",
       {"Source  ", "Symmetry  ", "SpectralContent  ", "ScatterType  ", "SampleRotation  ",
        "AngleOfIncidence  ", "ScatterAzimuth  ", "ScatterRadial  ", "Monochrome\nDataBegin", "TIS "}},
      {"minidiff",
       "",
       {"Source\t", "Symmetry\t", "SpectralContent\t", "ScatterAzimuth\t", "ScatterRadial\t", "DataBegin",
        "AOI ", "POI ", "Side ", "Wavelength ", "ScatterType ", "TIS "}},
      {"bird",
       "",
       {"\"theta_i\"", "\"phi_i\"", "\"theta_r\"", "\"phi_r\"", "\"BRDF\": {", "\"unit\"", "\"data\""}}};
  const EncodeOptions options{.theta_i = {radians(10), radians(40)},
                              .theta_step = radians(15),
                              .phi_step = radians(30),
                              .channel = 0,
                              .metadata = {{"sample", "leather"}}};
  for (TextFile& file : out) {
    file.text = encode_brdf(*make_model("ggx:alpha=0.5,f0=0.04,albedo=0.3").value(),
                            *writer_named(file.word).value(), options)
                    .value();
  }
  return out;
}

void require_good_error(const Result<std::shared_ptr<const Brdf>>& brdf) {
  REQUIRE_FALSE(brdf.has_value());
  CAPTURE(brdf.error().what);
  REQUIRE(brdf.error().what.starts_with("bad: "));
  REQUIRE(brdf.error().what.size() < 500);
  REQUIRE_FALSE(brdf.error().remedy.empty());
}

std::string replaced(std::string text, std::string_view from, std::string_view to) {
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

}  // namespace

TEST_CASE("Text files cut at every percent are refused") {
  for (const TextFile& file : text_files()) {
    REQUIRE(decode_brdf(file.text, "good").has_value());
    for (std::size_t percent = 0; percent < 100; ++percent) {
      CAPTURE(file.word, percent);
      // One block of MiniDiff may be a whole file: the second begins at the middle.
      const auto brdf =
          decode_brdf(std::string_view(file.text).substr(0, file.text.size() * percent / 100), "bad");
      require_good_error(brdf);
    }
  }
}

TEST_CASE("Text files with a keyword missing or doubled are refused") {
  for (const TextFile& file : text_files()) {
    for (const char* keyword : file.keywords) {
      CAPTURE(file.word, keyword);
      require_good_error(decode_brdf(replaced(file.text, keyword, "x "), "bad"));
      require_good_error(decode_brdf(replaced(file.text, keyword, std::string(keyword) + keyword), "bad"));
    }
  }
}

TEST_CASE("Header keywords may come in any order") {
  for (const TextFile& file : text_files()) {
    if (std::string_view(file.word) == "bird") {
      continue;
    }
    const std::size_t from = file.text.find("ScatterAzimuth");
    const std::size_t middle = file.text.find("ScatterRadial");
    const std::size_t to = file.text.find('\n', file.text.find('\n', middle) + 1) + 1;
    std::string swapped = file.text;
    swapped.replace(from, to - from,
                    file.text.substr(middle, to - middle) + file.text.substr(from, middle - from));
    const auto a = decode_brdf(file.text, "a").value();
    const auto b = decode_brdf(swapped, "b").value();
    std::array<double, 1> x{};
    std::array<double, 1> y{};
    const Direction o = from_spherical(0.3, 1);
    REQUIRE(a->eval(from_spherical(radians(10), 0), o, x) == b->eval(from_spherical(radians(10), 0), o, y));
    REQUIRE(x == y);
  }
}

TEST_CASE("Text files with wrong, huge and negative counts are refused before memory is taken") {
  for (const TextFile& file : text_files()) {
    for (const char* keyword : {"AngleOfIncidence  ", "SampleRotation  ", "ScatterAzimuth  ",
                                "ScatterRadial  ", "ScatterAzimuth\t", "ScatterRadial\t"}) {
      const std::size_t at = file.text.find(keyword);
      if (at == std::string::npos) {
        continue;
      }
      const std::size_t number = at + std::string_view(keyword).size();
      const std::size_t stop = file.text.find('\n', number);
      for (const char* count :
           {"0", "-1", "99999", "100001", "4294967297", "18446744073709551617", "1e3", "x", ""}) {
        CAPTURE(file.word, keyword, count);
        std::string text = file.text;
        require_good_error(decode_brdf(text.replace(number, stop - number, count), "bad"));
      }
    }
  }
}

TEST_CASE("Text files with numbers that are none are refused, with their line") {
  for (const TextFile& file : text_files()) {
    // Any value of the data: the last one.
    const bool json = std::string_view(file.word) == "bird";
    const std::size_t end =
        json ? file.text.find(']', file.text.find("\"BRDF\": {")) : file.text.find_last_of("0123456789") + 1;
    const std::size_t start = file.text.find_last_of(json ? "[," : "\t\n", end - 1) + 1;
    for (const char* number : {"nan", "inf", "-inf", "1e300", "0x10", "1,5", "--1", "1.2.3", "\x01"}) {
      CAPTURE(file.word, number);
      std::string text = file.text;
      text.replace(start, end - start, number);
      const auto brdf = decode_brdf(text, "bad");
      require_good_error(brdf);
      if (!json) {
        REQUIRE(brdf.error().what.starts_with("bad: line "));
      }
    }
    // Negative and tiny values occur in measured data and are kept.
    for (const char* number : {"-1.5E-05", "1E-60"}) {
      CAPTURE(file.word, number);
      std::string text = file.text;
      REQUIRE(decode_brdf(text.replace(start, end - start, number), "good").has_value());
    }
  }
}

TEST_CASE("Text files read the same with CRLF, CR and a byte-order mark") {
  for (const TextFile& file : text_files()) {
    for (const char* line_end : {"\r\n", "\r"}) {
      std::string text = "\xEF\xBB\xBF";
      for (const char c : file.text) {
        text += c == '\n' ? std::string(line_end) : std::string(1, c);
      }
      CAPTURE(file.word, line_end);
      const auto brdf = decode_brdf(text, "variant");
      REQUIRE(brdf.has_value());
      std::array<double, 1> x{};
      std::array<double, 1> y{};
      const Direction i = from_spherical(radians(10), 0);
      const Direction o = from_spherical(0.3, 1);
      REQUIRE((*brdf)->eval(i, o, x) == decode_brdf(file.text, "plain").value()->eval(i, o, y));
      REQUIRE(x == y);
    }
  }
}

TEST_CASE("Comments of ours that are damaged are told") {
  const std::string good = text_files()[0].text;
  for (const char* line :
       {"# scatter.@origin: 7*1\n", "# scatter.@origin: 99999999999*1\n", "# scatter.@origin: 1*4\n",
        "# scatter.key without end\n", "# scatter.key+ more\n", "# scatter.key: \\q\n",
        "# scatter.@wavelengths_nm: 1 2 3\n", "# scatter.@wavelengths_nm: x\n"}) {
    CAPTURE(line);
    require_good_error(
        decode_brdf(replaced(good, "Source  Measured\n", std::string(line) + "Source  Measured\n"), "bad"));
  }
}

TEST_CASE("What is no file is said so") {
  REQUIRE(open_brdf(std::filesystem::temp_directory_path().string()).error().what.find("is a folder") !=
          std::string::npos);
  REQUIRE(open_brdf("no/such/file").error().code == ErrorCode::kNotFound);
  REQUIRE(decode_brdf("", "bad").error().what == "bad: is empty");
  REQUIRE(decode_brdf("\xFF\xFE\x53\x00", "bad").error().code == ErrorCode::kInvalidArgument);
  const auto path = std::filesystem::temp_directory_path() / "scatter_bad_text_test.bsdf";
  REQUIRE(write_file(path, text_files()[0].text).has_value());
  std::filesystem::permissions(path, std::filesystem::perms::none);
  if (const auto brdf = open_brdf(path.string()); !brdf) {  // A superuser may read it.
    REQUIRE(brdf.error().code == ErrorCode::kPermissionDenied);
  }
  std::filesystem::remove(path);
}

TEST_CASE("Real text files cut at every percent are refused") {
  for (const char* name : {"bird/generation_c.json", "bird/example_generation_a.brdf"}) {
    const auto path = test::real_data(name);
    if (!path) {
      continue;
    }
    const std::string text = read_file(*path).value();
    for (std::size_t percent = 0; percent < 100; ++percent) {
      CAPTURE(name, percent);
      require_good_error(decode_brdf(std::string_view(text).substr(0, text.size() * percent / 100), "bad"));
    }
  }
}
