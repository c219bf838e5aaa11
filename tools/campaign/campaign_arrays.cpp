#include "tools/campaign/campaign_arrays.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <vector>

#include "tools/arrays/hdf5_file.hpp"
#include "tools/campaign/whole_file.hpp"
#include "transports/file/output_path.hpp"

namespace imud {

namespace {

using Sizes = std::vector<hsize_t>;

struct Box {
  Sizes begin, size;
};

// Divides consecutive items of an array, in the order of C, into boxes: fewer than two for each dimension.
std::vector<Box> boxes_of(hsize_t first, hsize_t end, const Sizes& sizes) {
  std::vector<Box> boxes;
  while (first < end) {
    Box box{.begin = Sizes(sizes.size()), .size = sizes};
    hsize_t rest = first, stride = 1;
    for (std::size_t i = sizes.size(); i-- > 0; rest /= sizes[i]) box.begin[i] = rest % sizes[i];
    std::size_t outer = sizes.size() - 1;  // the box has all of the dimensions behind it
    while (outer > 0 && box.begin[outer] == 0 && stride * sizes[outer] <= end - first) stride *= sizes[outer--];
    box.size[outer] = std::min(sizes[outer] - box.begin[outer], (end - first) / stride);
    std::fill_n(box.size.begin(), outer, 1);
    first += box.size[outer] * stride;
    boxes.push_back(std::move(box));
  }
  return boxes;
}

Hdf5Handle space_of(const Sizes& sizes) {
  return {H5Screate_simple(static_cast<int>(sizes.size()), sizes.data(), nullptr), H5Sclose};
}

void select(hid_t space, const Box& box) {
  require_hdf5(H5Sselect_hyperslab(space, H5S_SELECT_SET, box.begin.data(), nullptr, box.size.data(), nullptr) >= 0);
}

Hdf5Handle type_of_rows() {
  Hdf5Handle type(H5Tcreate(H5T_COMPOUND, row_size(false)), H5Tclose);
  std::size_t offset = 0;
  for (const MeasurementColumn& column : measurement_columns(false)) {
    const hsize_t values = column.values;
    const hid_t one = hdf5_type(column.type);
    const Hdf5Handle all(values > 1 ? H5Tarray_create2(one, 1, &values) : H5Tcopy(one), H5Tclose);
    require_hdf5(H5Tinsert(type, std::string(column.name).c_str(), offset, all) >= 0);
    offset += column.size();
  }
  return type;
}

// Writes the file of one campaign.
class ArraysWriter {
 public:
  ArraysWriter(const CampaignRows& rows, const std::string& path)
      : rows_(rows), file_(create_hdf5_file(path, H5F_LIBVER_V110, true)) {
    require_hdf5(H5Pset_create_intermediate_group(links_, 1) >= 0);
    for (const ArrayShape::Dimension& dimension : shape().dimensions) {
      add_axis(dimension);
      sizes_.push_back(dimension.size());
    }
    add_text(file_, "imud_version", rows_.campaign().version);
    add_text(file_, "plan_sha256", rows_.campaign().plan_sha256);
    for (std::size_t imu = 0; imu < shape().imus.size(); ++imu) add_imu(imu);
    require_hdf5(file_.close());
  }

 private:
  const ArrayShape& shape() const noexcept { return rows_.campaign().arrays; }

  // Makes a data set, with the groups that its name has.
  Hdf5Handle make(const std::string& name, hid_t type, hid_t space, hid_t properties) const {
    return {H5Dcreate2(file_, name.c_str(), type, space, links_, properties, H5P_DEFAULT), H5Dclose};
  }

  // The values along a dimension.
  void add_axis(const ArrayShape::Dimension& dimension) {
    const Hdf5Handle space = space_of({dimension.size()});
    const bool is_text = !dimension.values.empty();
    const Hdf5Handle type = is_text ? hdf5_text_type() : Hdf5Handle(H5Tcopy(H5T_NATIVE_UINT64), H5Tclose);
    const Hdf5Handle axis = make(fmt::format("axes/{}", sizes_.size()), type, space, H5P_DEFAULT);
    add_text(axis, "name", dimension.name);
    std::vector<const char*> texts;
    std::vector<std::uint64_t> numbers;
    for (const std::string& value : dimension.values) texts.push_back(value.c_str());
    for (std::uint64_t i = 0; i < dimension.count; ++i) numbers.push_back(dimension.first + i);
    const void* const values = is_text ? static_cast<const void*>(texts.data()) : numbers.data();
    require_hdf5(H5Dwrite(axis, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0);
  }

  void add_imu(std::size_t imu) const {
    const Hdf5Handle type = type_of_rows();
    const Hdf5Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    require_hdf5(H5Pset_fill_value(properties, type, rows_without_value(1).data()) >= 0);
    Sizes all = sizes_;
    all.push_back(shape().rows);
    const Hdf5Handle space = space_of(all);
    for (const CaseRange& shard : rows_.whole()) {
      const std::string source = add_shard(shard, imu, type);
      const Hdf5Handle of_shard = space_of({shard.size(), shape().rows});
      hsize_t begin = 0;
      for (Box& box : boxes_of(shard.first, shard.last + 1, sizes_)) {
        hsize_t cases = 1;
        for (const hsize_t size : box.size) cases *= size;
        select(of_shard, {{begin, 0}, {cases, shape().rows}});
        box.begin.push_back(0);
        box.size.push_back(shape().rows);
        select(space, box);
        require_hdf5(H5Pset_virtual(properties, space, ".", source.c_str(), of_shard) >= 0);
        begin += cases;
      }
    }
    require_hdf5(H5Sselect_all(space) >= 0);
    const Hdf5Handle array = make("arrays/" + shape().imus[imu], type, space, properties);
    std::vector<std::string> names;
    for (const ArrayShape::Dimension& dimension : shape().dimensions) names.push_back(dimension.name);
    names.emplace_back("row");
    add_texts(array, "DIMENSION_LABELS", names);  // as HDF5's dimension scales have it
    for (const MeasurementColumn& column : measurement_columns(false))
      add_column(array, std::string(column.name) + ".", column);
  }

  // Makes the data set of one imu in the file of a shard. Returns its name.
  std::string add_shard(const CaseRange& shard, std::size_t imu, hid_t type) const {
    const std::string file = array_name(shard);
    const std::uint64_t bytes = shard.size() * shape().block_bytes();
    const Hdf5Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    const std::string path = std::filesystem::canonical(rows_.shards_path() / file).string();
    require_hdf5(H5Pset_external(properties, path.c_str(), static_cast<off_t>(imu * bytes), bytes) >= 0);
    std::string name = fmt::format("/shards/{}/{}", file, shape().imus[imu]);
    make(name, type, space_of({shard.size(), shape().rows}), properties);
    return name;
  }

  const CampaignRows& rows_;
  Hdf5Handle file_;  // the first that calls HDF5
  const Hdf5Handle links_{H5Pcreate(H5P_LINK_CREATE), H5Pclose};
  Sizes sizes_;
};

}  // namespace

void check_campaign_arrays(const CampaignDescription& campaign, const std::string& path) {
  if (is_standard_output(path) || !FileReplacement::target(path))
    throw std::invalid_argument(fmt::format("--hdf5 {}: arrays cannot go to a stream; give a file", path));
  if (campaign.arrays.rows == 0)
    throw std::invalid_argument(
        "--hdf5: the campaign has kept no measurements; give the key `arrays`, and run it into a new folder");
  constexpr std::size_t most = H5S_MAX_RANK - 1;
  if (campaign.arrays.dimensions.size() > most)
    throw std::invalid_argument(fmt::format("--hdf5: an array has {} dimensions beside the rows, and HDF5 allows {}",
                                            campaign.arrays.dimensions.size(), most));
}

void write_campaign_arrays(const CampaignRows& rows, const std::string& path) {
  WholeFile file(path);
  try {
    ArraysWriter(rows, file.path());
  } catch (const std::filesystem::filesystem_error&) {
    throw;
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: {}", path, error.what()));
  }
  file.commit();
}

}  // namespace imud
