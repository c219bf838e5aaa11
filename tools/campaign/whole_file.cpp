#include "tools/campaign/whole_file.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "transports/file/output_path.hpp"
#include "transports/port_spec.hpp"

namespace imud {

WholeFile::WholeFile(std::string path) : path_(std::move(path)), incomplete_(path_) {
  if (is_standard_output(path_)) {
    incomplete_ = "-";
    return;
  }
  if (const std::string fault = foreign_link_fault(path_); !fault.empty()) throw std::runtime_error(fault);
  const auto target = FileReplacement::target(path_);
  if (!target) return;
  const PortSpec spec{"table", path_, {}};
  try {
    replacement_.emplace(spec, *target);
  } catch (const PortError& error) {
    throw std::runtime_error(std::string(error.what()).substr(spec.scheme.size() + 1));
  }
  incomplete_ = *target + std::string(FileReplacement::suffix);
}

void WholeFile::commit() {
  if (!replacement_) return;
  if (::fsync(replacement_->descriptor()) != 0) throw std::runtime_error(path_ + ": " + std::strerror(errno));
  replacement_->commit();
}

}  // namespace imud
