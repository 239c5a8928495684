// Embree on the scenes that `cargo bench --bench trace -- --export DIR` wrote: every crossing of
// every ray, in packets of 16 with a filter that counts and rejects.
//
// usage: embree DIR NAME...
// Prints, per scene and tab-separated: name, crossings, rays whose number of crossings differs
// from DIR/NAME.crossings, million rays per second of processor time (all threads together).
#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

// Rays of a packet; they follow one another in the file, a tile of 4 x 4.
constexpr size_t PACKET = 16;
constexpr int ATTEMPTS = 3;
constexpr double LEAST_SECONDS = 1.0;

struct Ray {
    float x, z, slope_x, slope_z;
};

template <typename T> std::vector<T> read(const std::string &path) {
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    if (!file) {
        std::fprintf(stderr, "cannot read %s\n", path.c_str());
        std::exit(1);
    }
    std::vector<T> items(static_cast<size_t>(file.tellg()) / sizeof(T));
    file.seekg(0);
    file.read(reinterpret_cast<char *>(items.data()),
              static_cast<std::streamsize>(items.size() * sizeof(T)));
    return items;
}

// What the filter adds to: crossings of the rays of a packet, by their ids.
struct Counter {
    RTCIntersectContext context;
    uint32_t crossings[PACKET];
};

void count_and_reject(const RTCFilterFunctionNArguments *args) {
    auto *counter = reinterpret_cast<Counter *>(args->context);
    for (unsigned i = 0; i < args->N; i++) {
        if (args->valid[i] != -1) continue;
        counter->crossings[RTCRayN_id(args->ray, args->N, i)] += 1;
        args->valid[i] = 0;
    }
}

RTCScene build(RTCDevice device, const std::vector<float> &corners) {
    RTCScene scene = rtcNewScene(device);
    // ROBUST: no ray slips through between two triangles.
    rtcSetSceneFlags(scene, RTCSceneFlags(RTC_SCENE_FLAG_ROBUST |
                                          RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION));
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_MEDIUM); // HIGH would split triangles
    RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    size_t vertices = corners.size() / 3;
    auto *at = static_cast<float *>(rtcSetNewGeometryBuffer(
        mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), vertices));
    std::copy(corners.begin(), corners.end(), at);
    auto *indices = static_cast<uint32_t *>(rtcSetNewGeometryBuffer(
        mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(uint32_t), vertices / 3));
    for (uint32_t i = 0; i < vertices; i++) indices[i] = i;
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(scene, mesh);
    rtcReleaseGeometry(mesh);
    rtcCommitScene(scene);
    return scene;
}

// Traces the packets [first, last).
void trace(RTCScene scene, const std::vector<Ray> &rays, float start, size_t first, size_t last,
           std::vector<uint32_t> &crossings) {
    alignas(64) int valid[PACKET];
    std::fill(valid, valid + PACKET, -1);
    for (size_t p = first; p < last; p++) {
        alignas(64) RTCRay16 packet;
        Counter counter;
        rtcInitIntersectContext(&counter.context);
        counter.context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
        counter.context.filter = count_and_reject;
        for (unsigned i = 0; i < PACKET; i++) {
            const Ray &ray = rays[p * PACKET + i];
            packet.org_x[i] = ray.x + ray.slope_x * start;
            packet.org_y[i] = start;
            packet.org_z[i] = ray.z + ray.slope_z * start;
            packet.dir_x[i] = ray.slope_x;
            packet.dir_y[i] = 1.0f;
            packet.dir_z[i] = ray.slope_z;
            packet.tnear[i] = 0.0f;
            packet.tfar[i] = -2.0f * start;
            packet.time[i] = 0.0f;
            packet.mask[i] = ~0u;
            packet.id[i] = i;
            packet.flags[i] = 0;
            counter.crossings[i] = 0;
        }
        rtcOccluded16(valid, scene, &counter.context, &packet);
        std::copy(counter.crossings, counter.crossings + PACKET, &crossings[p * PACKET]);
    }
}

double processor_time() {
    timespec time;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

int main(int count, char **arguments) {
    if (count < 3) {
        std::fprintf(stderr, "usage: embree DIR NAME...\n");
        return 2;
    }
    RTCDevice device = rtcNewDevice(nullptr);
    unsigned threads = std::max(1u, std::thread::hardware_concurrency());
    std::fprintf(stderr, "Embree %s, packets of 16 %s, %u threads\n", RTC_VERSION_STRING,
                 rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)
                     ? "native"
                     : "emulated",
                 threads);
    for (int i = 2; i < count; i++) {
        std::string stem = std::string(arguments[1]) + "/" + arguments[i];
        auto corners = read<float>(stem + ".triangles");
        auto rays = read<Ray>(stem + ".rays");
        auto ours = read<uint32_t>(stem + ".crossings");
        if (rays.size() % PACKET != 0 || ours.size() != rays.size()) {
            std::fprintf(stderr, "%s: not whole packets\n", stem.c_str());
            return 1;
        }
        float reach = 0.0f;
        for (size_t c = 0; c < corners.size(); c += 3) {
            reach = std::max(reach, std::hypot(corners[c], corners[c + 1]));
        }
        RTCScene scene = build(device, corners);
        std::vector<uint32_t> crossings(rays.size());
        auto all = [&] {
            std::vector<std::thread> team;
            size_t packets = rays.size() / PACKET;
            for (size_t t = 0; t < threads; t++) {
                team.emplace_back(trace, scene, std::cref(rays), -1.01f * reach - 1e-6f,
                                  packets * t / threads, packets * (t + 1) / threads,
                                  std::ref(crossings));
            }
            for (auto &thread : team) thread.join();
        };
        all();
        double best = 0.0;
        for (int attempt = 0; attempt < ATTEMPTS; attempt++) {
            double begin = processor_time(), passed = 0.0;
            size_t traced = 0;
            while (passed < LEAST_SECONDS) {
                all();
                traced += rays.size();
                passed = processor_time() - begin;
            }
            best = std::max(best, static_cast<double>(traced) / passed / 1e6);
        }
        uint64_t total = 0, differ = 0;
        for (size_t r = 0; r < rays.size(); r++) {
            total += crossings[r];
            differ += crossings[r] != ours[r];
        }
        std::printf("%s\t%llu\t%llu\t%.4f\n", arguments[i], (unsigned long long)total,
                    (unsigned long long)differ, best);
        std::fflush(stdout);
        rtcReleaseScene(scene);
    }
    rtcReleaseDevice(device);
}
