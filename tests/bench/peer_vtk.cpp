/* Frames of isogi_dvr.h and meshes of isogi_vol.h beside VTK's, of the same fields: on one machine, one thread, turn by turn in one run.
   `make bench-peers` builds and runs it where VTK 9's headers are (libvtk9-dev).

       build/bench/peer_vtk [REPETITIONS] [PICTURES]

   CPU seconds, medians. Frames: 512x512 in the standard view, the transfer function of the scenes ml256 and gyroid256. Ours: lit by
   visibility of 64^3 points under a uniform sky and a sun, as the rows frame-* of bench_dvr, and unlit. VTK's: its fixed-point ray
   caster, half-voxel steps, plain and shaded by the gradient under the same sun. goal: the design's goal / VTK's time when the goals
   were set, the mean of the two that the design gives. Meshes: vtkFlyingEdges3D without and with normals, of the gyroid.
   PICTURES: a folder; the frames are written there as PPM, each over black, as they are: not converted to sRGB. */
#include "isogi_dvr.h"
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <time.h>
#include <vector>
#include <vtkAutoInit.h>
#include <vtkCamera.h>
#include <vtkColorTransferFunction.h>
#include <vtkFixedPointRayCastImage.h>
#include <vtkFixedPointVolumeRayCastMapper.h>
#include <vtkFlyingEdges3D.h>
#include <vtkImageData.h>
#include <vtkLight.h>
#include <vtkNew.h>
#include <vtkPiecewiseFunction.h>
#include <vtkPolyData.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>
#include <vtkSMPTools.h>
#include <vtkVolume.h>
#include <vtkVolumeProperty.h>

VTK_MODULE_INIT(vtkRenderingVolumeOpenGL2) /* has the helper without which VTK's caster is not made; nothing is drawn by it */

enum { N = 256, WIDTH = 512 };

static double cpu_seconds() {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double median(std::vector<double> seconds) {
    std::sort(seconds.begin(), seconds.end());
    return seconds[seconds.size() / 2];
}

/* A field on the cube, its volume for either side, and the tent of the scene as a transfer function. */
struct scene {
    bool gyroid;
    double isovalue;
    vtkNew<vtkImageData> image;
    isogi_volume volume;
    isogi_pyramid *pyramid;
    isogi_transfer_point point[5];
    float eye[3];
};

static isogi_context serial() {
    isogi_context c = isogi_context();
    c.threads = 1;
    return c;
}

static void scene_make(scene &s, bool gyroid) {
    const double pi = 3.14159265358979323846, spacing = 2.0 / (N - 1), away = std::sqrt(3) / std::sin(pi / 8) / std::sqrt(1.5 * 1.5 + 1.2 * 1.2 + 4);
    const double colour[3][3] = {{.2, .3, .9}, {.9, .8, .6}, {.9, .2, .2}};
    const isogi_context context = serial();
    double range[2];
    s.gyroid = gyroid, s.isovalue = gyroid ? 0 : 0.5;
    s.image->SetDimensions(N, N, N), s.image->SetSpacing(spacing, spacing, spacing), s.image->SetOrigin(-1, -1, -1);
    s.image->AllocateScalars(VTK_FLOAT, 1);
    float *data = (float *)s.image->GetScalarPointer();
    for (size_t i = 0; i < (size_t)N * N * N; i++) {
        double x = spacing * (double)(i % N) - 1, y = spacing * (double)(i / N % N) - 1, z = spacing * (double)(i / N / N) - 1;
        if (gyroid) {
            x = 2 * pi * (x + 1), y = 2 * pi * (y + 1), z = 2 * pi * (z + 1);
            data[i] = (float)(std::sin(x) * std::cos(y) + std::sin(y) * std::cos(z) + std::sin(z) * std::cos(x));
        } else data[i] = (float)((1 - std::sin(pi * z / 2) + 0.25 * (1 + std::cos(2 * pi * 6 * std::cos(pi * std::sqrt(x * x + y * y) / 2)))) / 2.5);
    }
    s.volume = isogi_volume();
    s.volume.data = data, s.volume.type = ISOGI_F32;
    for (int a = 0; a < 3; a++) s.volume.size[a] = N, s.volume.spacing[a] = spacing, s.volume.origin[a] = -1;
    if (isogi_vol_build(&s.pyramid, &s.volume, &context) != ISOGI_OK) std::exit(1);
    isogi_vol_range(s.pyramid, range);
    const double half = 0.05 * (range[1] - range[0]), value[5] = {range[0], s.isovalue - half, s.isovalue, s.isovalue + half, range[1]};
    for (int i = 0; i < 5; i++) { /* colour is linear from either end to the isovalue */
        const double *end = colour[i < 2 ? 0 : 2], u = (value[i] - s.isovalue) / (value[i < 2 ? 0 : 4] - s.isovalue);
        s.point[i].value = value[i], s.point[i].extinction = i == 2 ? 0.357f : 0;
        for (int a = 0; a < 3; a++) s.point[i].rgb[a] = (float)(colour[1][a] + u * (end[a] - colour[1][a]));
    }
    s.eye[0] = (float)(1.5 * away), s.eye[1] = (float)(1.2 * away), s.eye[2] = (float)(2 * away);
}

static void picture(const char *folder, const scene &s, const char *name, const std::vector<float> &rgb) {
    if (!folder) return;
    std::string path = std::string(folder) + "/" + (s.gyroid ? "gyroid-" : "ml-") + name + ".ppm";
    FILE *f = std::fopen(path.c_str(), "wb");
    if (!f) return (void)std::perror(path.c_str());
    std::fprintf(f, "P6\n%d %d\n255\n", WIDTH, WIDTH);
    for (float x : rgb) std::fputc((int)(255 * std::min(1.f, std::max(0.f, x)) + 0.5f), f);
    if (std::fclose(f)) std::perror(path.c_str());
}

struct our_frames {
    isogi_dvr *dvr;
    isogi_view view;
    std::vector<float> pixels, rgb;
};

static void our_make(our_frames &o, const scene &s, bool lit) {
    isogi_dvr_desc desc = isogi_dvr_desc();
    isogi_transfer transfer = isogi_transfer();
    const isogi_context context = serial();
    desc.pyramid = s.pyramid, desc.shading = lit ? ISOGI_DVR_VISIBILITY : ISOGI_DVR_UNLIT, desc.order = 3, desc.directions = 32;
    for (int a = 0; a < 3; a++) desc.grid[a] = 64;
    transfer.points = s.point, transfer.point_count = 5;
    o.view = isogi_view(), o.view.width = o.view.height = WIDTH;
    for (int a = 0; a < 3; a++) o.view.eye[a] = s.eye[a];
    o.pixels.resize(4 * WIDTH * WIDTH), o.rgb.resize(3 * WIDTH * WIDTH);
    if (isogi_dvr_create(&o.dvr, &desc, &context) != ISOGI_OK || isogi_dvr_set_transfer(o.dvr, &transfer) != ISOGI_OK) std::exit(1);
    if (isogi_dvr_step(o.dvr, 0, NULL) != ISOGI_OK) std::exit(1);
}

static double our_frame(our_frames &o) {
    static const float sky[3] = {3.5449077f, 3.5449077f, 3.5449077f};
    isogi_light sun = isogi_light();
    isogi_lighting lighting = isogi_lighting();
    for (int a = 0; a < 3; a++) sun.vector[a] = 1, sun.rgb[a] = 2;
    lighting.env.sh = sky, lighting.env.sh_order = 1, lighting.lights = &sun, lighting.light_count = 1;
    double start = cpu_seconds();
    if (isogi_dvr_render(o.dvr, &o.view, &lighting, (float(*)[4])o.pixels.data(), NULL, NULL) != ISOGI_OK) std::exit(1);
    start = cpu_seconds() - start;
    for (size_t i = 0; i < o.rgb.size(); i++) o.rgb[i] = o.pixels[i / 3 * 4 + i % 3];
    return start;
}

/* VTK's caster without a window on a screen: what its Render() does, except for showing the image. */
struct vtk_frames {
    vtkNew<vtkFixedPointVolumeRayCastMapper> mapper;
    vtkNew<vtkVolume> volume;
    vtkNew<vtkVolumeProperty> property;
    vtkNew<vtkColorTransferFunction> colour;
    vtkNew<vtkPiecewiseFunction> opacity;
    vtkNew<vtkRenderWindow> window;
    vtkNew<vtkRenderer> renderer;
    vtkNew<vtkLight> sun;
    std::vector<float> rgb;
};

static void vtk_make(vtk_frames &v, const scene &s, bool shaded) {
    const double spacing = 2.0 / (N - 1), away = std::sqrt((double)s.eye[0] * s.eye[0] + (double)s.eye[1] * s.eye[1] + (double)s.eye[2] * s.eye[2]);
    for (int i = 0; i < 5; i++) v.colour->AddRGBPoint(s.point[i].value, s.point[i].rgb[0], s.point[i].rgb[1], s.point[i].rgb[2]);
    v.opacity->AddPoint(s.point[0].value, 0);
    for (int i = 0; i <= 16; i++) { /* opacity is not linear where extinction is */
        double u = i / 8.0 - 1;
        v.opacity->AddPoint(s.isovalue + u * (s.point[3].value - s.isovalue), 1 - std::exp(-(double)s.point[2].extinction * (1 - std::fabs(u))));
    }
    v.opacity->AddPoint(s.point[4].value, 0);
    v.property->SetColor(v.colour), v.property->SetScalarOpacity(v.opacity), v.property->SetScalarOpacityUnitDistance(spacing);
    v.property->SetInterpolationTypeToLinear(), v.property->SetShade(shaded);
    v.property->SetAmbient(0.5), v.property->SetDiffuse(0.7), v.property->SetSpecular(0);
    v.mapper->SetInputData(s.image), v.mapper->SetNumberOfThreads(1), v.mapper->AutoAdjustSampleDistancesOff();
    v.mapper->SetSampleDistance((float)(0.5 * spacing)), v.mapper->SetImageSampleDistance(1), v.mapper->IntermixIntersectingGeometryOff();
    v.volume->SetMapper(v.mapper), v.volume->SetProperty(v.property);
    v.window->SetOffScreenRendering(1), v.window->SetSize(WIDTH, WIDTH), v.window->AddRenderer(v.renderer);
    v.sun->SetLightTypeToSceneLight(), v.sun->SetPositional(0), v.sun->SetPosition(1, 1, 1), v.sun->SetFocalPoint(0, 0, 0);
    v.renderer->AddLight(v.sun), v.renderer->AddVolume(v.volume);
    vtkCamera *camera = v.renderer->GetActiveCamera();
    camera->SetPosition(s.eye[0], s.eye[1], s.eye[2]), camera->SetFocalPoint(0, 0, 0), camera->SetViewUp(0, 1, 0), camera->SetViewAngle(45);
    camera->SetClippingRange(away - 1.8, away + 1.8);
}

static double vtk_frame(vtk_frames &v) {
    double none[3] = {0, 0, 0}, start = cpu_seconds();
    int extent[6] = {0, 0, 0, 0, 0, 0}, memory[2], in_use[2], origin[2];
    v.mapper->PerImageInitialization(v.renderer, v.volume, 0, none, none, extent);
    v.mapper->PerVolumeInitialization(v.renderer, v.volume);
    v.mapper->PerSubVolumeInitialization(v.renderer, v.volume, 0);
    v.mapper->RenderSubVolume();
    start = cpu_seconds() - start;
    vtkFixedPointRayCastImage *image = v.mapper->GetRayCastImage();
    const unsigned short *pixel = image->GetImage(); /* the part of the window that the volume covers; rows from below; 32767 is 1 */
    image->GetImageMemorySize(memory), image->GetImageInUseSize(in_use), image->GetImageOrigin(origin);
    v.rgb.assign(3 * WIDTH * WIDTH, 0);
    for (int y = 0; y < in_use[1]; y++)
        for (int x = 0; x < in_use[0]; x++)
            for (int a = 0; a < 3; a++)
                if (x + origin[0] < WIDTH && y + origin[1] < WIDTH)
                    v.rgb[3 * ((size_t)(WIDTH - 1 - y - origin[1]) * WIDTH + (size_t)(x + origin[0])) + (size_t)a] =
                        (float)pixel[4 * ((size_t)y * (size_t)memory[0] + (size_t)x) + (size_t)a] / 32767;
    return start;
}

static void line(const char *name, const scene &s, double ours, double theirs, double goal) {
    std::printf("%-16s %-8s %8.3f %8.3f %7.3f %7.3f\n", name, s.gyroid ? "gyroid" : "ml", ours, theirs, ours / theirs, goal);
    std::fflush(stdout);
}

static void compare_frames(const scene &s, int runs, const char *folder) {
    our_frames plain, lit;
    vtk_frames unshaded, shaded;
    std::vector<double> seconds[4];
    our_make(plain, s, false), our_make(lit, s, true), vtk_make(unshaded, s, false), vtk_make(shaded, s, true);
    vtk_frame(unshaded), vtk_frame(shaded), our_frame(plain), our_frame(lit); /* gradients and tables are made in the first frame */
    for (int i = 0; i < runs; i++) {
        seconds[0].push_back(our_frame(plain)), seconds[1].push_back(vtk_frame(unshaded));
        seconds[2].push_back(our_frame(lit)), seconds[3].push_back(vtk_frame(shaded));
    }
    line("frame unshaded", s, median(seconds[0]), median(seconds[1]), 0.1 / 0.585);
    line("frame lit", s, median(seconds[2]), median(seconds[3]), 0.1 / 0.85);
    line("lit / unshaded", s, median(seconds[2]), median(seconds[1]), 0.1 / 0.585);
    picture(folder, s, "isogi", plain.rgb), picture(folder, s, "isogi-lit", lit.rgb);
    picture(folder, s, "vtk", unshaded.rgb), picture(folder, s, "vtk-shaded", shaded.rgb);
    isogi_dvr_free(plain.dvr), isogi_dvr_free(lit.dvr);
}

static void compare_meshes(const scene &s, int runs) {
    for (int normals = 0; normals < 2; normals++) {
        vtkNew<vtkFlyingEdges3D> edges;
        isogi_mesh mesh = isogi_mesh();
        isogi_mesh_desc desc = isogi_mesh_desc();
        std::vector<double> ours, theirs;
        desc.isovalue = s.isovalue, desc.normals = normals;
        edges->SetInputData(s.image), edges->SetValue(0, s.isovalue), edges->SetComputeNormals(normals), edges->ComputeGradientsOff(), edges->ComputeScalarsOff();
        for (int i = 0; i <= runs; i++) { /* the first one finds memory */
            double start = cpu_seconds();
            if (isogi_vol_mesh(s.pyramid, &desc, &mesh) != ISOGI_OK) std::exit(1);
            if (i) ours.push_back(cpu_seconds() - start);
            edges->Modified(), start = cpu_seconds(), edges->Update();
            if (i) theirs.push_back(cpu_seconds() - start);
        }
        line(normals ? "mesh normals" : "mesh", s, median(ours), median(theirs), normals ? 80 / 87.0 : 60 / 75.0);
        if (!normals) std::printf("                 ours %zu triangles, VTK %lld\n", mesh.triangle_count, (long long)edges->GetOutput()->GetNumberOfPolys());
        isogi_vol_mesh_free(s.pyramid, &mesh);
    }
}

int main(int argc, char **argv) {
    int runs = argc > 1 ? std::atoi(argv[1]) : 5;
    if (runs < 1 || argc > 3) return std::fprintf(stderr, "usage: peer_vtk [REPETITIONS] [PICTURES]\n"), 2;
    vtkSMPTools::Initialize(1);
    std::printf("%-16s %-8s %8s %8s %7s %7s\n", "CPU seconds", "", "ours", "VTK", "ratio", "goal");
    for (int gyroid = 0; gyroid < 2; gyroid++) {
        scene s;
        scene_make(s, gyroid);
        compare_frames(s, runs, argc > 2 ? argv[2] : NULL);
        if (gyroid) compare_meshes(s, runs);
        isogi_vol_free(s.pyramid);
    }
    return 0;
}
