#include "tools/scatter/file_description.h"

#include "tools/scatter/brdf_description.h"
#include "tools/scatter/preparation.h"
#include "tools/scatter/recording_description.h"

namespace scatter::cli {

Result<Answer> describe_file(const std::string& file_or_spec) {
  if (looks_like_recording(file_or_spec)) {
    return describe_recording(file_or_spec);
  }
  const auto brdf = open_subject(file_or_spec);
  if (!brdf) {
    return std::unexpected(brdf.error());
  }
  return describe_brdf(file_or_spec, **brdf);
}

}  // namespace scatter::cli
