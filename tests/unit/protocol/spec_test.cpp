// SPEC.md against the code, and the machine-readable description against both.
#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <sstream>

#include "protocol/crc.h"
#include "protocol/schema_description.h"
#include "tests/unit/protocol/spec_tables.h"
#include "tests/unit/protocol/test_bytes.h"

namespace scatter::protocol::test {
namespace {

std::string file_text(const std::string& path) {
  std::ifstream file(path);
  INFO(path);
  REQUIRE(file);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::string description(Detail detail) {
  std::string text;
  describe_schema([&](std::string_view piece) { text += piece; }, detail);
  return text;
}

TEST_CASE("The tables of SPEC.md are those of the code") {
  const std::string spec = file_text("protocol/SPEC.md");
  const std::string fresh = with_fresh_tables(spec);
  std::istringstream old_lines(spec);
  std::istringstream new_lines(fresh);
  std::string differences;
  std::string old_line;
  std::string new_line;
  for (int number = 1; differences.size() < 2000; ++number) {
    const bool has_old = static_cast<bool>(std::getline(old_lines, old_line));
    const bool has_new = static_cast<bool>(std::getline(new_lines, new_line));
    if (!has_old && !has_new) {
      break;
    }
    if (!has_old || !has_new || old_line != new_line) {
      differences += "line " + std::to_string(number) + "\n- " + (has_old ? old_line : "") + "\n+ " +
                     (has_new ? new_line : "") + "\n";
    }
  }
  INFO(differences << "Rewrite the tables: build protocol_spec_tables, then run\n"
                      "  protocol_spec_tables protocol/SPEC.md");
  CHECK(differences.empty());
  for (const char* name : {"header", "status", "messages", "fields", "objects"}) {
    INFO(name);
    CHECK(spec.find("<!-- table " + std::string(name) + " -->") != std::string::npos);
  }
}

TEST_CASE("Every rule that a test cites stands in SPEC.md") {
  const std::string spec = file_text("protocol/SPEC.md");
  std::set<std::string> rules;
  const std::regex rule(R"(\n- \*\*(\d+\.\d+)\*\* )");
  for (std::sregex_iterator it(spec.begin(), spec.end(), rule), end; it != end; ++it) {
    CHECK(rules.insert((*it)[1]).second);
  }
  std::set<std::string> cited;
  for (const char* name : {"codec_test.cpp", "golden_vectors_test.cpp", "link_decoder_test.cpp",
                           "serial_test.cpp", "session_test.cpp", "spec_test.cpp"}) {
    const std::string source = file_text("tests/unit/protocol/" + std::string(name));
    const std::regex citation(R"(// PROVES: SPEC ([0-9., ]+)\n)");
    const std::regex number(R"(\d+\.\d+)");
    for (std::sregex_iterator it(source.begin(), source.end(), citation), end; it != end; ++it) {
      const std::string list = (*it)[1];
      for (std::sregex_iterator one(list.begin(), list.end(), number); one != end; ++one) {
        INFO(name << " cites " << one->str());
        CHECK(rules.contains(one->str()));
        cited.insert(one->str());
      }
    }
  }
  CHECK(cited.size() >= 25);
}

// PROVES: SPEC 6.6
TEST_CASE("The schema digest is the CRC-32C of the description without meanings") {
  const std::string text = description(Detail::kWire);
  CHECK(schema_digest() == crc32c(std::as_bytes(std::span(text))));
  CHECK(text.find("meaning") == std::string::npos);
}

// PROVES: SPEC 6.6
TEST_CASE("The machine-readable description is valid JSON and names every message and field") {
  std::istringstream lines(description(Detail::kFull));
  std::map<std::string, nlohmann::json> messages;
  std::size_t statuses = 0;
  for (std::string line; std::getline(lines, line);) {
    const auto json = nlohmann::json::parse(line);
    if (json.contains("message")) {
      messages[json["message"].get<std::string>()] = json;
    }
    statuses += json.contains("status") ? 1 : 0;
  }
  CHECK(statuses == kStatusTable.size());
  CHECK(messages.size() == std::tuple_size_v<AllMessages>);
  const auto& credit = messages["credit"];
  CHECK(credit["id"] == 8);
  CHECK(credit["channel"] == "event");
  CHECK(credit["fields"][1]["path"] == "may_send_until");
  CHECK(credit["fields"][1]["type"] == "u32");
  const auto& listed = messages["calibration_listed"]["fields"];
  CHECK(listed[0]["type"] == "struct[<=8]");
  CHECK(listed[1]["path"] == "manifests[].id");
  CHECK(listed[1]["type"] == "u8[16]");
}

// The golden script's schema is independent of ours; the lengths of its largest vectors are our maxima.
TEST_CASE("The longest message of each kind is as long in the golden vectors as the code says") {
  const auto golden = nlohmann::json::parse(file_text("tests/golden/protocol_vectors.json"));
  for (const auto& vector : golden["frames"]) {
    for_each_message([&]<typename M>() {
      if (vector["name"] == std::string(M::kName) + " max" && !has_tail<M>()) {
        INFO(M::kName);
        CHECK(vector["payload"].get<std::string>().size() / 2 == max_encoded_size<M>());
      }
    });
  }
}

}  // namespace
}  // namespace scatter::protocol::test
