// objects.json and annotations.json, made from the records that journals keep.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <set>

#include "backend/batch/annotations_file.h"
#include "backend/batch/objects_file.h"
#include "backend/batch/view_record.h"
#include "tests/unit/render_scene.h"

namespace octrace::test {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

class BatchFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("octrace_batch_files_" + std::to_string(::getpid()) + "_" +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string path(const char* name) const { return (folder_ / name).string(); }
  json read(const char* name) const { return json::parse(std::ifstream(folder_ / name)); }
  std::filesystem::path folder_;
};

// 6 x 4: object 2 above, object 5 below, one pixel of object 9.
const std::vector<std::uint32_t> kIds = {0, 2, 2, 2, 0, 0,  //
                                         0, 2, 2, 2, 0, 0,  //
                                         5, 5, 5, 5, 5, 5,  //
                                         5, 5, 5, 5, 5, 9};

ordered_json line(int view, int scene, const std::vector<std::uint32_t>& ids) {
  return {{"kind", "view"},
          {"view", view},
          {"scene", scene},
          {"name", scene == 0 ? "first" : "second"},
          {"camera", "c"},
          {"frame", 0},
          {"size", {6, 4}},
          {"files", {{{"path", "v" + std::to_string(view) + ".png"}, {"bytes", 1}}}},
          {"objects", batch::objects_record(batch::find_objects(ids, 6, 4, true))}};
}

batch::SceneLines scenes() {
  const auto object = [](int id, const char* name, const char* mesh) {
    return ordered_json{{"id", id}, {"name", name}, {"mesh", mesh}, {"materials", {"red"}}};
  };
  batch::SceneLines lines;
  lines[0] = {{"name", "first"},
              {"source", "a.glb"},
              {"objects",
               {object(2, "chair.001", "chair"), object(5, "floor", "floor"),
                object(9, "chair.002", "chair")}}};
  lines[1] = {{"name", "second"},
              {"source", "b.glb"},
              {"objects",
               {object(2,
                       "b\xff"
                       "ad",
                       "apple"),
                object(5, "f", "floor"), object(9, "n", "nail")}}};
  return lines;
}

TEST_F(BatchFiles, ObjectsNameThemAndSayWhereTheyAre) {
  auto file = batch::ObjectsFile::create(path("objects.json"), scenes());
  ASSERT_TRUE(file);
  ASSERT_TRUE(file->add(line(0, 0, kIds)));
  ASSERT_TRUE(file->add(line(7, 1, std::vector<std::uint32_t>(24, 0))));
  ASSERT_TRUE(file->finish());
  const json objects = read("objects.json");
  ASSERT_EQ(objects["scenes"].size(), 2u);
  EXPECT_EQ(
      objects["scenes"][0]["objects"][0],
      json({{"object_id", 2}, {"name", "chair.001"}, {"mesh", "chair"}, {"materials", {"red"}}}));
  ASSERT_EQ(objects["views"].size(), 2u);
  const json& seen = objects["views"][0]["objects"];
  ASSERT_EQ(seen.size(), 3u);
  EXPECT_EQ(seen[0], json({{"object_id", 2}, {"pixels", 6}, {"bbox", {1, 0, 3, 2}}}));
  EXPECT_EQ(seen[1], json({{"object_id", 5}, {"pixels", 11}, {"bbox", {0, 2, 6, 2}}}));
  EXPECT_EQ(seen[2], json({{"object_id", 9}, {"pixels", 1}, {"bbox", {5, 3, 1, 1}}}));
  EXPECT_THAT(objects["views"][1]["objects"], IsEmpty());
  EXPECT_EQ(objects["views"][1]["view"], 7);
}

// What COCO's own reader relies on: ids that are unique and known, areas and boxes of the mask.
TEST_F(BatchFiles, AnnotationsAreACocoFile) {
  for (const auto counts : {batch::MaskCounts::compressed, batch::MaskCounts::uncompressed}) {
    auto file = batch::AnnotationsFile::create(path("annotations.json"), scenes(), counts);
    ASSERT_TRUE(file);
    ASSERT_TRUE(file->add(line(0, 0, kIds)));
    ASSERT_TRUE(file->add(line(1, 1, kIds)));
    ASSERT_TRUE(file->finish());
    const json coco = read("annotations.json");
    ASSERT_EQ(coco["images"].size(), 2u);
    EXPECT_EQ(coco["images"][1],
              json({{"id", 1}, {"width", 6}, {"height", 4}, {"file_name", "v1.png"}}));
    std::map<int, std::string> categories;
    for (const json& category : coco["categories"]) categories[category["id"]] = category["name"];
    EXPECT_EQ(categories,
              (std::map<int, std::string>{{1, "apple"}, {2, "chair"}, {3, "floor"}, {4, "nail"}}));
    std::set<int> ids;
    std::vector<std::string> named;
    for (const json& annotation : coco["annotations"]) {
      ids.insert(annotation["id"].get<int>());
      named.push_back(categories.at(annotation["category_id"]));
      EXPECT_EQ(annotation["segmentation"]["size"], json({4, 6}));
      EXPECT_EQ(annotation["iscrowd"], 0);
    }
    EXPECT_EQ(ids.size(), 6u);
    EXPECT_GT(*ids.begin(), 0);
    EXPECT_THAT(named, ElementsAre("chair", "floor", "chair", "apple", "floor", "nail"));
    const json& chair = coco["annotations"][0];
    EXPECT_EQ(chair["bbox"], json({1, 0, 3, 2}));
    EXPECT_EQ(chair["area"], 6);
    EXPECT_EQ(chair["image_id"], 0);
    // By columns: 4 outside, 2 inside, 2 outside, 2, 2, 2, 10.
    if (counts == batch::MaskCounts::uncompressed) {
      EXPECT_EQ(chair["segmentation"]["counts"], json({4, 2, 2, 2, 2, 2, 10}));
      EXPECT_EQ(coco["annotations"][2]["segmentation"]["counts"], json({23, 1}));
    } else {
      EXPECT_EQ(chair["segmentation"]["counts"], "4220008");
    }
  }
  std::set<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    files.insert(entry.path().filename().string());
  }
  EXPECT_THAT(files, ElementsAre("annotations.json"));
}

TEST_F(BatchFiles, RecordsThatBreakTheRulesAreErrorsAndLeaveNothing) {
  {
    auto file = batch::AnnotationsFile::create(path("annotations.json"), scenes(),
                                               batch::MaskCounts::uncompressed);
    ASSERT_TRUE(file);
    ordered_json bad = line(0, 0, kIds);
    bad["objects"][0]["rle"] = "0000";
    EXPECT_FALSE(file->add(bad));
    bad = line(0, 0, kIds);
    bad["objects"][0]["id"] = 4;  // an object that the scene does not have
    EXPECT_FALSE(file->add(bad));
    bad = line(0, 0, kIds);
    bad["objects"][0].erase("rle");
    EXPECT_FALSE(file->add(bad));
    bad = line(0, 0, kIds);
    bad["size"] = {0, -1};
    EXPECT_FALSE(file->add(bad));
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
  batch::SceneLines broken;
  broken[0] = {{"name", "x"}};
  EXPECT_FALSE(batch::ObjectsFile::create(path("objects.json"), broken));
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST_F(BatchFiles, ASceneRecordListsWhatHasGeometry) {
  scene::Scene scene = empty_scene();
  const std::uint32_t red = add_material(scene, matte({1, 0, 0}));
  add_mesh(scene, make_quad({0, 0, 0}, 1), red);
  add_mesh(scene, make_quad({0, 0, 1}, 1), 0);
  scene.object_names = {"left", "right"};
  scene.object_meshes = {"quad", ""};
  scene.material_names.resize(scene.materials.size());
  scene.material_names[red] = "red";
  const ordered_json record = batch::scene_objects_record(scene);
  ASSERT_EQ(record.size(), 2u);
  EXPECT_EQ(record[0].dump(), R"({"id":1,"name":"left","mesh":"quad","materials":["red"]})");
  EXPECT_EQ(record[1]["mesh"], "right");
}

}  // namespace
}  // namespace octrace::test
