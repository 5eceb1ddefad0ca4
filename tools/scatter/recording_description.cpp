#include "tools/scatter/recording_description.h"

#include <fmt/format.h>

#include <fstream>
#include <iterator>
#include <system_error>

#include "host_sdk/device/recording_reader.h"
#include "host_sdk/formats/classify.h"
#include "tools/scatter/measurement_json.h"
#include "tools/scatter/text_table.h"
#include "tools/scatter/times.h"

namespace scatter::cli {
namespace {

const char* target_name(protocol::Target target) {
  switch (target) {
    case protocol::Target::kSample:
      return "sample";
    case protocol::Target::kDarkCap:
      return "dark cap";
    case protocol::Target::kWhiteReference:
      return "white reference";
    case protocol::Target::kBlackReference:
      return "black reference";
    case protocol::Target::kTranslucentReference:
      return "translucent reference";
  }
  return "unknown target";
}

/// Reads every frame of a run; counts by the ledger.
Result<protocol::Ledger> ledger_of(const device::RecordingReader& reader, std::size_t run) {
  auto cursor = reader.frames(run);
  if (!cursor) {
    return std::unexpected(cursor.error());
  }
  for (;;) {
    auto frame = cursor->next();
    if (!frame) {
      return std::unexpected(frame.error());
    }
    if (!*frame) {
      return cursor->summary().ledger;
    }
  }
}

}  // namespace

bool looks_like_recording(const std::filesystem::path& file) {
  // A pipe would wait for somebody who writes.
  if (std::error_code error; !std::filesystem::is_regular_file(file, error)) {
    return false;
  }
  std::string head(4096, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(head.data(), std::ssize(head));
  head.resize(static_cast<std::size_t>(stream.gcount()));
  return formats::classify(head) == formats::Format::kRecording;
}

Result<Answer> describe_recording(const std::filesystem::path& file) {
  const auto reader = device::RecordingReader::open(file);
  if (!reader) {
    return std::unexpected(reader.error());
  }
  Answer answer;
  std::vector<std::vector<std::string>> rows = {{"recording", file.string()}};
  const std::string created = utc_text(reader->info().creation_unix_ns);
  rows.push_back({"created", fmt::format("{} by {}", created, reader->info().tool)});
  auto& json = answer.json;
  json["kind"] = "recording";
  json["file"] = file.string();
  json["created"] = created;
  json["tool"] = reader->info().tool;
  json["bytes"] = reader->size_bytes();
  if (const auto hello = reader->hello()) {
    rows.push_back({"instrument", fmt::format("{} {}, firmware {}", hello->product.str(), hello->serial.str(),
                                              hello->build_id.str())});
    json["product"] = hello->product.str();
    json["serial"] = hello->serial.str();
    json["firmware"] = hello->build_id.str();
  }
  auto& runs = json["runs"] = nlohmann::ordered_json::array();
  for (std::size_t k = 0; k < reader->runs().size(); ++k) {
    const auto ledger = ledger_of(*reader, k);
    if (!ledger) {
      return std::unexpected(ledger.error());
    }
    const auto& recipe = reader->runs()[k].configuration.recipe;
    runs.push_back({{"target", target_name(recipe.target)},
                    {"illuminations", recipe.illuminations.size()},
                    {"repeats", recipe.repeats},
                    {"ended", reader->runs()[k].report.has_value()},
                    {"ledger", to_json(*ledger)}});
    rows.push_back({fmt::format("run {}", k + 1),
                    fmt::format("{}, {} illuminations, {} sweeps: {}", target_name(recipe.target),
                                recipe.illuminations.size(), recipe.repeats, words(*ledger))});
  }
  auto& attachments = json["attachments"] = nlohmann::ordered_json::array();
  std::string names;
  for (const auto& name : reader->attachment_names()) {
    attachments.push_back(name);
    names += (names.empty() ? "" : ", ") + name;
  }
  rows.push_back({"attachments", names.empty() ? "none" : names});
  const auto integrity = reader->verify();
  json["integrity"] = {{"perfect", integrity.perfect()},
                       {"truncated", integrity.truncated},
                       {"bytes_lost", integrity.bytes_lost},
                       {"corrupted_records", integrity.corrupted_records},
                       {"text", integrity.text()}};
  rows.push_back({"integrity", integrity.perfect() ? "every checksum is right" : integrity.text()});
  answer.text = text_table(rows);
  return answer;
}

}  // namespace scatter::cli
