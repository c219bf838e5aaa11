// The linear algebra types of the model: fixed size, double, on the stack.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace imud {

using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;
using Quaternion = Eigen::Quaterniond;

}  // namespace imud
