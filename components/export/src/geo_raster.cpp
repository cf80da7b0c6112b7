// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "gdal_errors.hpp"
#include "geo_files.hpp"
#include <gdal_priv.h>
#include <ogr_spatialref.h>

#include <array>
#include <limits>
#include <memory>
#include <vector>

namespace trigpoint::exporter {

namespace {

struct CloseDataset {
  void operator()(GDALDataset* dataset) const { GDALClose(dataset); }
};

using Dataset = std::unique_ptr<GDALDataset, CloseDataset>;

GDALDriver& driver_of(const char* name, const std::string& file) {
  GDALDriver* driver = GetGDALDriverManager()->GetDriverByName(name);
  GdalErrors::check(driver != nullptr, file, std::string("find GDAL's driver ") + name);
  return *driver;
}

Dataset create_tiff(const std::string& file,
                    const Grid& grid,
                    int bands,
                    GDALDataType type,
                    const std::string& wkt) {
  std::vector<const char*> options{"COMPRESS=DEFLATE", "TILED=YES", "BIGTIFF=IF_SAFER"};
  if (bands == 4) {
    options.push_back("ALPHA=YES");
    options.push_back("PHOTOMETRIC=RGB");
  }
  options.push_back(nullptr);
  Dataset dataset(driver_of("GTiff", file)
                      .Create(file.c_str(),
                              grid.columns,
                              grid.rows,
                              bands,
                              type,
                              const_cast<char**>(options.data())));
  GdalErrors::check(dataset != nullptr, file, "create");
  std::array<double, 6> transform{
      grid.north_west.x(), grid.cell.x(), 0.0, grid.north_west.y(), 0.0, -grid.cell.y()};
  dataset->SetGeoTransform(transform.data());
  OGRSpatialReference reference;
  reference.importFromWkt(wkt.c_str());
  dataset->SetSpatialRef(&reference);
  GdalErrors::check(true, file, "say where it lies");
  return dataset;
}

/// All four bands, which lie interleaved in `rgba`.
void write_rgba(GDALDataset& dataset,
                const Grid& grid,
                std::vector<std::uint8_t> rgba,
                const std::string& file) {
  const CPLErr error = dataset.RasterIO(GF_Write,
                                        0,
                                        0,
                                        grid.columns,
                                        grid.rows,
                                        rgba.data(),
                                        grid.columns,
                                        grid.rows,
                                        GDT_Byte,
                                        4,
                                        nullptr,
                                        4,
                                        4 * static_cast<GSpacing>(grid.columns),
                                        1,
                                        nullptr);
  GdalErrors::check(error == CE_None, file, "write");
}

/// What was still in GDAL's cache is written when the dataset closes.
void close(Dataset dataset, GdalTarget& target, const std::string& file) {
  dataset.reset();
  GdalErrors::check(true, file, "write");
  target.commit();
}

}  // namespace

void write_height_tiff(const std::string& file, const TopView& view, const std::string& wkt) {
  const GdalErrors errors;
  GdalTarget target(file);
  const Grid& grid = view.grid();
  Dataset dataset = create_tiff(target.part(), grid, 1, GDT_Float32, wkt);
  GDALRasterBand* band = dataset->GetRasterBand(1);
  band->SetNoDataValue(std::numeric_limits<double>::quiet_NaN());
  band->SetDescription("highest point, m above the WGS 84 ellipsoid");
  band->SetUnitType("m");
  std::vector<float> heights_m = view.heights_m();
  const CPLErr error = band->RasterIO(GF_Write,
                                      0,
                                      0,
                                      grid.columns,
                                      grid.rows,
                                      heights_m.data(),
                                      grid.columns,
                                      grid.rows,
                                      GDT_Float32,
                                      0,
                                      0,
                                      nullptr);
  GdalErrors::check(error == CE_None, file, "write");
  close(std::move(dataset), target, file);
}

void write_picture_tiff(const std::string& file, const TopView& view, const std::string& wkt) {
  const GdalErrors errors;
  GdalTarget target(file);
  Dataset dataset = create_tiff(target.part(), view.grid(), 4, GDT_Byte, wkt);
  write_rgba(*dataset, view.grid(), view.picture(), file);
  close(std::move(dataset), target, file);
}

void write_png(const std::string& file, const TopView& view) {
  const GdalErrors errors;
  GdalTarget target(file);
  const Grid& grid = view.grid();
  // GDAL's PNG driver only copies.
  Dataset memory(driver_of("MEM", file).Create("", grid.columns, grid.rows, 4, GDT_Byte, nullptr));
  GdalErrors::check(memory != nullptr, file, "hold the picture");
  write_rgba(*memory, grid, view.picture(), file);
  Dataset png(driver_of("PNG", file)
                  .CreateCopy(target.part().c_str(), memory.get(), 0, nullptr, nullptr, nullptr));
  GdalErrors::check(png != nullptr, file, "create");
  close(std::move(png), target, file);
}

}  // namespace trigpoint::exporter
