// The rays of `cargo bench --bench traverse` through Embree, one at a time, in robust mode, on one thread.
// Reads "SCENE SET QUERY" from each line and answers with hits and CPU seconds, as the bench does with --serve. "batched8" asks
// about occlusion in streams of 8 rays.
//
//     g++ -O3 -march=native embree.cpp -lembree3 -o embree && ./embree FOLDER
#include <embree3/rtcore.h>
#include <time.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

struct Cast { float o[3], d[3], near, far, time; };

static std::ifstream open(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    if (!in) { fprintf(stderr, "%s: cannot be read\n", path.c_str()); exit(1); }
    return in;
}

template <class T> static std::vector<T> read(std::ifstream& in, size_t count) {
    std::vector<T> values(count);
    in.read(reinterpret_cast<char*>(values.data()), count * sizeof(T));
    if (!in) { fprintf(stderr, "a file ends early\n"); exit(1); }
    return values;
}

static uint32_t number(std::ifstream& in) { return read<uint32_t>(in, 1)[0]; }

static RTCScene new_scene(RTCDevice device) {
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    return scene;
}

static void fill(RTCGeometry geometry, RTCBufferType type, unsigned slot, RTCFormat format, size_t stride,
                 size_t count, const void* from) {
    memcpy(rtcSetNewGeometryBuffer(geometry, type, slot, format, stride, count), from, stride * count);
}

static void attach(RTCScene scene, RTCGeometry geometry) {
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
}

static RTCScene load(RTCDevice device, const std::string& path) {
    std::ifstream in = open(path);
    std::vector<RTCGeometry> meshes;
    std::vector<std::pair<uint32_t, uint32_t>> sizes;
    for (uint32_t left = number(in); left > 0; left--) {
        uint32_t keys = number(in), vertices = number(in), triangles = number(in);
        RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
        rtcSetGeometryTimeStepCount(mesh, keys);
        for (uint32_t key = 0; key < keys; key++) {
            auto positions = read<float>(in, 3 * size_t(vertices));
            fill(mesh, RTC_BUFFER_TYPE_VERTEX, key, RTC_FORMAT_FLOAT3, 12, vertices, positions.data());
        }
        auto indices = read<uint32_t>(in, 3 * size_t(triangles));
        fill(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, triangles, indices.data());
        meshes.push_back(mesh);
        sizes.push_back({keys, vertices});
    }
    std::vector<RTCScene> shared(meshes.size());
    RTCScene scene = new_scene(device);
    uint32_t placed = number(in);
    for (uint32_t i = 0; i < placed; i++) {
        uint32_t mesh = number(in);
        auto matrix = read<float>(in, 12);
        // one mesh where it is needs no second level: what a user of Embree would do
        if (placed == 1) {
            for (uint32_t key = 0; key < sizes[mesh].first; key++) {
                auto* p = static_cast<float*>(rtcGetGeometryBufferData(meshes[mesh], RTC_BUFFER_TYPE_VERTEX, key));
                for (size_t x = 0; x < 3 * size_t(sizes[mesh].second); x++) p[x] += matrix[9 + x % 3];
            }
            attach(scene, meshes[mesh]);
            continue;
        }
        if (!shared[mesh]) {
            shared[mesh] = new_scene(device);
            attach(shared[mesh], meshes[mesh]);
            rtcCommitScene(shared[mesh]);
        }
        RTCGeometry instance = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE);
        rtcSetGeometryInstancedScene(instance, shared[mesh]);
        rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, matrix.data());
        attach(scene, instance);
    }
    uint32_t spheres = number(in);
    if (spheres > 0) {
        auto values = read<float>(in, 4 * size_t(spheres));
        RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_SPHERE_POINT);
        fill(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 16, spheres, values.data());
        attach(scene, geometry);
    }
    rtcCommitScene(scene);
    return scene;
}

static double seconds() {
    timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return now.tv_sec + 1e-9 * now.tv_nsec;
}

static RTCRay ray_of(const Cast& c) {
    RTCRay ray{};
    ray.org_x = c.o[0]; ray.org_y = c.o[1]; ray.org_z = c.o[2];
    ray.dir_x = c.d[0]; ray.dir_y = c.d[1]; ray.dir_z = c.d[2];
    ray.tnear = c.near; ray.tfar = c.far; ray.time = c.time;
    ray.mask = ~0u;
    return ray;
}

int main(int count, char** words) {
    if (count != 2) { fprintf(stderr, "usage: embree FOLDER\n"); return 2; }
    std::string folder = words[1], line, loaded;
    RTCDevice device = rtcNewDevice("threads=1");
    RTCScene scene = nullptr;
    std::map<std::string, std::vector<Cast>> sets;
    while (std::getline(std::cin, line)) {
        std::istringstream parts(line);
        std::string name, set, query;
        parts >> name >> set >> query;
        if (name != loaded) {
            if (scene) rtcReleaseScene(scene);
            scene = load(device, folder + "/" + name + ".scene");
            loaded = name;
        }
        auto& casts = sets[name + "-" + set];
        if (casts.empty()) {
            std::ifstream in = open(folder + "/" + name + "-" + set + ".rays");
            casts = read<Cast>(in, number(in));
        }
        size_t hits = 0, stream = 0;
        sscanf(query.c_str(), "batched%zu", &stream);
        RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        double start = seconds();
        if (query == "closest") {
            for (const Cast& cast : casts) {
                RTCRayHit hit{};
                hit.ray = ray_of(cast);
                hit.hit.geomID = hit.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
                rtcIntersect1(scene, &context, &hit);
                hits += hit.hit.geomID != RTC_INVALID_GEOMETRY_ID;
            }
        } else if (stream > 0) {
            std::vector<RTCRay> rays(stream);
            for (size_t first = 0; first < casts.size(); first += stream) {
                size_t size = std::min(stream, casts.size() - first);
                for (size_t i = 0; i < size; i++) rays[i] = ray_of(casts[first + i]);
                rtcOccluded1M(scene, &context, rays.data(), size, sizeof(RTCRay));
                for (size_t i = 0; i < size; i++) hits += rays[i].tfar < 0;
            }
        } else {
            for (const Cast& cast : casts) {
                RTCRay ray = ray_of(cast);
                rtcOccluded1(scene, &context, &ray);
                hits += ray.tfar < 0;
            }
        }
        printf("%zu %.9f\n", hits, seconds() - start);
        fflush(stdout);
    }
}
