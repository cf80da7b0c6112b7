// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Small parts that the conversions of all messages share.
#pragma once

#include "trigpoint/base/pose.hpp"
#include "trigpoint/bus/convert.hpp"

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <string>

namespace trigpoint::bus {

/// Matrix elements row by row, as ROS lists them.
template <int Rows, int Columns>
std::array<double, Rows * Columns> row_major(const Eigen::Matrix<double, Rows, Columns>& matrix) {
  std::array<double, Rows * Columns> elements{};
  for (int row = 0; row < Rows; ++row) {
    for (int column = 0; column < Columns; ++column) {
      elements[static_cast<std::size_t>(row * Columns + column)] = matrix(row, column);
    }
  }
  return elements;
}

template <int Rows, int Columns = Rows>
Eigen::Matrix<double, Rows, Columns> from_row_major(
    const std::array<double, Rows * Columns>& elements) {
  Eigen::Matrix<double, Rows, Columns> matrix;
  for (int row = 0; row < Rows; ++row) {
    for (int column = 0; column < Columns; ++column) {
      matrix(row, column) = elements[static_cast<std::size_t>(row * Columns + column)];
    }
  }
  return matrix;
}

/// The enumerator of a number on the wire; one that is not known becomes `cautious`.
template <class Enum>
Enum enumerator(std::uint8_t number, Enum last, Enum cautious) {
  return number <= static_cast<std::uint8_t>(last) ? static_cast<Enum>(number) : cautious;
}

std_msgs::msg::Header header_of(Nanoseconds stamp_ns, const std::string& frame_id);
geometry_msgs::msg::Vector3 vector_message(const Eigen::Vector3d& vector);
Eigen::Vector3d vector_of(const geometry_msgs::msg::Vector3& message);
geometry_msgs::msg::Quaternion quaternion_message(const Eigen::Quaterniond& q);
Eigen::Quaterniond quaternion_of(const geometry_msgs::msg::Quaternion& message);

}  // namespace trigpoint::bus
