// Lists the Vulkan devices of this machine, one line each: name, API version, `ray-query` or `-`,
// separated by tabs; then a line `layer: validation` where the Khronos layer is installed.
// Needs no Vulkan headers, so that set-up can ask before anything is installed. Exit 1: no loader.
// With any argument it breaks a rule of Vulkan, to which a validation layer at work objects.

#include <cstdint>
#include <cstdio>
#include <cstring>
#include <vector>
#include <dlfcn.h>

// The few declarations of vulkan_core.h that are used here.
typedef void (*Function)();
typedef Function (*GetInstanceProcAddr)(void *instance, const char *name);
struct ApplicationInfo {
    uint32_t type;
    const void *next;
    const char *application;
    uint32_t application_version;
    const char *engine;
    uint32_t engine_version;
    uint32_t api_version;
};
struct InstanceCreateInfo {
    uint32_t type;
    const void *next;
    uint32_t flags;
    const ApplicationInfo *application;
    uint32_t layer_count;
    const char *const *layers;
    uint32_t extension_count;
    const char *const *extensions;
};
struct ExtensionProperties {
    char name[256];
    uint32_t version;
};
struct LayerProperties {
    char name[256];
    uint32_t spec_version, version;
    char description[256];
};
struct DeviceProperties {
    uint32_t api_version, driver_version, vendor, device, type;
    char name[256];
    unsigned char rest[4096];
};

template <typename F> static F load(GetInstanceProcAddr get, void *instance, const char *name) {
    return reinterpret_cast<F>(get(instance, name));
}

int main(int argc, char **) {
    void *loader = nullptr;
    for (const char *name : {"libvulkan.so.1", "libvulkan.1.dylib", "/opt/homebrew/lib/libvulkan.1.dylib",
                             "/usr/local/lib/libvulkan.1.dylib"})
        if (!loader) loader = dlopen(name, RTLD_NOW);
    if (!loader) return 1;
    auto get = reinterpret_cast<GetInstanceProcAddr>(dlsym(loader, "vkGetInstanceProcAddr"));
    if (!get) return 1;

    auto instance_extensions = load<int32_t (*)(const char *, uint32_t *, ExtensionProperties *)>(
        get, nullptr, "vkEnumerateInstanceExtensionProperties");
    auto instance_layers = load<int32_t (*)(uint32_t *, LayerProperties *)>(
        get, nullptr, "vkEnumerateInstanceLayerProperties");
    auto create = load<int32_t (*)(const InstanceCreateInfo *, const void *, void **)>(
        get, nullptr, "vkCreateInstance");
    if (!instance_extensions || !instance_layers || !create) return 1;

    // Portability drivers (MoltenVK) show only where they are asked for.
    const char *portability = "VK_KHR_portability_enumeration";
    bool portable = false;
    uint32_t count = 0;
    instance_extensions(nullptr, &count, nullptr);
    std::vector<ExtensionProperties> extensions(count);
    instance_extensions(nullptr, &count, extensions.data());
    for (const auto &e : extensions) portable = portable || !strcmp(e.name, portability);

    const uint32_t type = argc > 1 ? 48 : 0;
    ApplicationInfo application = {type, nullptr, "beamlet-setup", 0, nullptr, 0, (1u << 22) | (2u << 12)};
    InstanceCreateInfo info = {1, nullptr, portable ? 1u : 0u, &application, 0, nullptr, portable ? 1u : 0u, &portability};
    void *instance = nullptr;
    if (create(&info, nullptr, &instance) == 0) {
        auto enumerate = load<int32_t (*)(void *, uint32_t *, void **)>(get, instance, "vkEnumeratePhysicalDevices");
        auto properties = load<void (*)(void *, DeviceProperties *)>(get, instance, "vkGetPhysicalDeviceProperties");
        auto device_extensions = load<int32_t (*)(void *, const char *, uint32_t *, ExtensionProperties *)>(
            get, instance, "vkEnumerateDeviceExtensionProperties");
        count = 0;
        enumerate(instance, &count, nullptr);
        std::vector<void *> devices(count);
        enumerate(instance, &count, devices.data());
        devices.resize(count);
        for (void *device : devices) {
            static DeviceProperties p;
            properties(device, &p);
            count = 0;
            device_extensions(device, nullptr, &count, nullptr);
            extensions.resize(count);
            device_extensions(device, nullptr, &count, extensions.data());
            bool ray_query = false;
            for (const auto &e : extensions) ray_query = ray_query || !strcmp(e.name, "VK_KHR_ray_query");
            printf("%s\t%u.%u.%u\t%s\n", p.name, p.api_version >> 22 & 127, p.api_version >> 12 & 1023,
                   p.api_version & 4095, ray_query ? "ray-query" : "-");
        }
    }

    count = 0;
    instance_layers(&count, nullptr);
    std::vector<LayerProperties> layers(count);
    instance_layers(&count, layers.data());
    for (const auto &l : layers)
        if (!strcmp(l.name, "VK_LAYER_KHRONOS_validation")) printf("layer: validation\n");
    return 0;
}
