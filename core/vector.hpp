// The linear algebra types of the model: of fixed size, in double, without allocation.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace imud {

using Vector2 = Eigen::Vector2d;
using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;
using Quaternion = Eigen::Quaterniond;

}  // namespace imud
