// Hdf5File: what the writers of HDF5 files have in common.
#pragma once

#include <hdf5.h>

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "protocols/measurements/measurement_row.hpp"

namespace imud {

// Owns an identifier of HDF5.
class Hdf5Handle {
 public:
  // Throws std::runtime_error if there is none.
  Hdf5Handle(hid_t id, herr_t (*closer)(hid_t));
  Hdf5Handle(Hdf5Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Hdf5Handle& operator=(Hdf5Handle&&) = delete;
  ~Hdf5Handle() { close(); }
  operator hid_t() const noexcept { return id_; }
  // Returns false if it fails.
  bool close() noexcept { return id_ < 0 || close_(std::exchange(id_, -1)) >= 0; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

// Throws std::runtime_error if a call has failed.
void require_hdf5(bool good);
// Creates a file, in the format of that version of HDF5 and later ones. `is_locked`: the caller has locked the file,
// which HDF5 does itself otherwise. Throws std::runtime_error.
Hdf5Handle create_hdf5_file(const std::string& path, H5F_libver_t version, bool is_locked = false);
// Returns the type of a MeasurementColumn::type.
hid_t hdf5_type(std::string_view type);
// Returns the type of texts in UTF-8.
Hdf5Handle hdf5_text_type();
// These add an attribute to a file, a group or a data set.
void add_text(hid_t object, const std::string& name, std::string_view text);
void add_texts(hid_t object, const std::string& name, std::span<const std::string> texts);
void add_number(hid_t object, const std::string& name, std::uint64_t value);
// Adds the attributes `unit`, `frame` and `meaning` of a column, with `prefix` before their names.
void add_column(hid_t object, const std::string& prefix, const MeasurementColumn& column);

}  // namespace imud
