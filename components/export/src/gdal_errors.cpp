// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "gdal_errors.hpp"

#include "line_file.hpp"
#include <cpl_error.h>
#include <gdal.h>

#include <cstdio>
#include <filesystem>
#include <stdexcept>

namespace trigpoint::exporter {

GdalErrors::GdalErrors() {
  GDALAllRegister();
  CPLPushErrorHandler(CPLQuietErrorHandler);
  CPLErrorReset();
}

GdalErrors::~GdalErrors() {
  CPLPopErrorHandler();
}

void GdalErrors::check(bool done, const std::string& file, const std::string& what) {
  if (done && CPLGetLastErrorType() < CE_Failure) {
    return;
  }
  const std::string words = CPLGetLastErrorMsg();
  throw std::runtime_error(file + ": cannot " + what + (words.empty() ? "" : ": " + words));
}

GdalTarget::GdalTarget(const std::string& file) : file_(file) {
  const std::filesystem::path path(file);
  part_ = (path.parent_path() / (path.stem().string() + ".part" + path.extension().string()));
}

GdalTarget::~GdalTarget() {
  std::remove(part_.c_str());  // is gone after commit()
  std::remove((part_ + ".aux.xml").c_str());
}

void GdalTarget::commit() {
  if (std::rename(part_.c_str(), file_.c_str()) != 0) {
    throw_errno(file_, "replace");
  }
}

}  // namespace trigpoint::exporter
