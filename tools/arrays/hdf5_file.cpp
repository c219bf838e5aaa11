#include "tools/arrays/hdf5_file.hpp"

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "transports/file/output_path.hpp"

namespace imud {

Hdf5Handle::Hdf5Handle(hid_t id, herr_t (*closer)(hid_t)) : id_(id), close_(closer) { require_hdf5(id >= 0); }

void require_hdf5(bool good) {
  if (!good) throw std::runtime_error("HDF5 has failed");
}

Hdf5Handle create_hdf5_file(const std::string& path, H5F_libver_t version, bool is_locked) {
  H5dont_atexit();  // at exit it would write again to a file that could not be closed, and crash (1.10.8)
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  if (const std::string fault = foreign_link_fault(path); !fault.empty()) throw std::runtime_error(fault);
  // Attributes above 64 KiB need the format of version 1.8, which is from 2008; virtual data sets need version 1.10.
  const Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  require_hdf5(H5Pset_libver_bounds(access, version, version) >= 0);
  if (is_locked) require_hdf5(H5Pset_file_locking(access, false, false) >= 0);
  const hid_t file = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access);
  if (file < 0) throw std::runtime_error(path + ": cannot write it");
  return {file, H5Fclose};
}

hid_t hdf5_type(std::string_view type) {
  return type == "i8"   ? H5T_NATIVE_INT64
         : type == "u8" ? H5T_NATIVE_UINT64
         : type == "u4" ? H5T_NATIVE_UINT32
                        : H5T_NATIVE_DOUBLE;
}

Hdf5Handle hdf5_text_type() {
  Hdf5Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  require_hdf5(H5Tset_size(type, H5T_VARIABLE) >= 0 && H5Tset_cset(type, H5T_CSET_UTF8) >= 0);
  return type;
}

void add_text(hid_t object, const std::string& name, std::string_view text) {
  const Hdf5Handle type = hdf5_text_type();
  const Hdf5Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Hdf5Handle attribute(H5Acreate2(object, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  const std::string copy(text);
  const char* begin = copy.c_str();
  require_hdf5(H5Awrite(attribute, type, static_cast<const void*>(&begin)) >= 0);
}

void add_texts(hid_t object, const std::string& name, std::span<const std::string> texts) {
  const Hdf5Handle type = hdf5_text_type();
  const hsize_t size = texts.size();
  const Hdf5Handle space(H5Screate_simple(1, &size, nullptr), H5Sclose);
  const Hdf5Handle attribute(H5Acreate2(object, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  std::vector<const char*> begins;
  for (const std::string& text : texts) begins.push_back(text.c_str());
  require_hdf5(H5Awrite(attribute, type, static_cast<const void*>(begins.data())) >= 0);
}

void add_number(hid_t object, const std::string& name, std::uint64_t value) {
  const Hdf5Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Hdf5Handle attribute(H5Acreate2(object, name.c_str(), H5T_NATIVE_UINT64, space, H5P_DEFAULT, H5P_DEFAULT),
                             H5Aclose);
  require_hdf5(H5Awrite(attribute, H5T_NATIVE_UINT64, &value) >= 0);
}

void add_column(hid_t object, const std::string& prefix, const MeasurementColumn& column) {
  add_text(object, prefix + "unit", column.unit);
  if (!column.frame.empty()) add_text(object, prefix + "frame", column.frame);
  add_text(object, prefix + "meaning", column.meaning);
}

}  // namespace imud
