//! Geometry that rays are sent through, and the same as triangles and spheres for other programs.

use abbe::geometry::deforming::{self, KeyFrame};
use abbe::geometry::{Accel, Instance, LensShape, Mesh, Shape, Shutter, Transform};
use abbe::math::hash;
use abbe::optics::{Aperture, LensSurface, Profile};
use glam::{DAffine3, DMat3, DQuat, DVec3, dvec3};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Vertices and triangles; a second list of vertices is where they are when the shutter closes.
pub struct Triangles {
    pub keys: Vec<Vec<[f32; 3]>>,
    pub indices: Vec<[u32; 3]>,
}

/// Geometry for abbe and for its peers.
pub struct Scene {
    pub name: &'static str,
    pub accel: Accel,
    /// Meshes in their own space.
    pub meshes: Vec<Triangles>,
    /// Placed meshes: which, and where.
    pub placed: Vec<(usize, DAffine3)>,
    /// Center and radius.
    pub spheres: Vec<(DVec3, f64)>,
    /// Whether triangles and spheres are all there is.
    pub is_shared: bool,
}

const SHUTTER: Shutter = Shutter {
    open_s: 0.0,
    close_s: 1.0,
};

/// A fixed stream of numbers in [0, 1).
pub fn numbers(stream: u64) -> impl FnMut() -> f64 {
    let mut i = 0u64;
    move || {
        i += 1;
        hash::unit_f64(hash::random_bits(stream, i))
    }
}

/// A point of the unit sphere.
pub fn on_sphere(u: f64, v: f64) -> DVec3 {
    let z = 1.0 - 2.0 * u;
    let r = (1.0 - z * z).sqrt();
    dvec3(r * (TAU * v).cos(), r * (TAU * v).sin(), z)
}

/// A sphere of `rows` times twice as many columns, with single vertices at the poles; `radius` of
/// polar angle and azimuth.
fn ball(rows: u32, columns: u32, radius: impl Fn(f64, f64) -> f64) -> Triangles {
    let vertex = |row: u32, column: u32| {
        let theta = PI * f64::from(row) / f64::from(rows);
        let phi = TAU * f64::from(column) / f64::from(columns);
        let p = dvec3(
            theta.sin() * phi.cos(),
            theta.cos(),
            theta.sin() * phi.sin(),
        ) * radius(theta, phi);
        p.as_vec3().to_array()
    };
    let mut positions = vec![vertex(0, 0)];
    for row in 1..rows {
        positions.extend((0..columns).map(|column| vertex(row, column)));
    }
    positions.push(vertex(rows, 0));
    let last = positions.len() as u32 - 1;
    let index = |row: u32, column: u32| match row {
        0 => 0,
        r if r == rows => last,
        r => 1 + (r - 1) * columns + column % columns,
    };
    let mut indices = Vec::new();
    for row in 0..rows {
        for c in 0..columns {
            let quad = [
                index(row, c),
                index(row, c + 1),
                index(row + 1, c + 1),
                index(row + 1, c),
            ];
            indices.push([quad[0], quad[1], quad[2]]);
            indices.push([quad[0], quad[2], quad[3]]);
        }
    }
    indices.retain(|[a, b, c]| a != b && b != c && c != a);
    Triangles {
        keys: vec![positions],
        indices,
    }
}

impl Triangles {
    fn shape(&self) -> Shape {
        let mesh = Mesh::new(&self.keys[0], None, None, self.indices.clone());
        Shape::Mesh(Arc::new(mesh.expect("a valid mesh")))
    }
}

fn place(shape: Shape, to_world: DAffine3) -> Instance {
    Instance {
        shape,
        transform: Transform::fixed(to_world),
    }
}

/// Radius 1 + 0.05 sin(12 θ) sin(16 φ) + 0.01 sin(60 θ) sin(80 φ): a million triangles.
pub fn million() -> Scene {
    let mesh = ball(500, 1000, |theta, phi| {
        1.0 + 0.05 * (12.0 * theta).sin() * (16.0 * phi).sin()
            + 0.01 * (60.0 * theta).sin() * (80.0 * phi).sin()
    });
    let up = DAffine3::from_translation(dvec3(0.0, 1.15, 0.0));
    Scene {
        name: "million",
        accel: Accel::build(vec![place(mesh.shape(), up)]),
        meshes: vec![mesh],
        placed: vec![(0, up)],
        spheres: Vec::new(),
        is_shared: true,
    }
}

/// The Cornell box: five walls, a lamp and two blocks; quads are two triangles each for peers.
#[expect(clippy::approx_constant, reason = "a place in a room")]
pub fn cornell() -> Scene {
    let quad = |center: [f64; 3], u: [f64; 3], v: [f64; 3]| {
        let (u, v) = (DVec3::from(u), DVec3::from(v));
        DAffine3 {
            matrix3: DMat3::from_cols(u, v, u.cross(v).normalize()),
            translation: DVec3::from(center),
        }
    };
    let quads = [
        quad([2.75, 0.0, 2.75], [0.0, 0.0, 2.75], [2.75, 0.0, 0.0]),
        quad([2.75, 5.5, 2.75], [2.75, 0.0, 0.0], [0.0, 0.0, 2.75]),
        quad([2.75, 2.75, 5.5], [0.0, 2.75, 0.0], [2.75, 0.0, 0.0]),
        quad([5.5, 2.75, 2.75], [0.0, 0.0, 2.75], [0.0, 2.75, 0.0]),
        quad([0.0, 2.75, 2.75], [0.0, 2.75, 0.0], [0.0, 0.0, 2.75]),
        quad([2.75, 5.49, 2.75], [0.65, 0.0, 0.0], [0.0, 0.0, 0.55]),
    ];
    let short = [(1.3, 0.65), (0.82, 2.25), (2.4, 2.72), (2.9, 1.14)];
    let tall = [(4.23, 2.47), (2.65, 2.96), (3.14, 4.56), (4.72, 4.06)];
    let mut blocks = Triangles {
        keys: vec![Vec::new()],
        indices: Vec::new(),
    };
    for (corners, height) in [(short, 1.65), (tall, 3.3)] {
        let first = blocks.keys[0].len() as u32;
        for y in [height, 0.0] {
            blocks.keys[0].extend(corners.map(|(x, z)| [x as f32, y as f32, z as f32]));
        }
        let faces = [
            [0, 1, 2, 3],
            [7, 6, 5, 4],
            [0, 4, 5, 1],
            [1, 5, 6, 2],
            [2, 6, 7, 3],
            [3, 7, 4, 0],
        ];
        for [a, b, c, d] in faces.map(|f| f.map(|i| first + i)) {
            blocks.indices.extend([[a, b, c], [a, c, d]]);
        }
    }
    let mut all = Triangles {
        keys: blocks.keys.clone(),
        indices: blocks.indices.clone(),
    };
    for map in &quads {
        let first = all.keys[0].len() as u32;
        for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            let p = map.transform_point3(dvec3(x, y, 0.0));
            all.keys[0].push(p.as_vec3().to_array());
        }
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| first + i);
        all.indices.extend([[a, b, c], [a, c, d]]);
    }
    let mut instances: Vec<_> = quads.map(|map| place(Shape::Quad, map)).into();
    instances.push(place(blocks.shape(), DAffine3::IDENTITY));
    Scene {
        name: "cornell",
        accel: Accel::build(instances),
        meshes: vec![all],
        placed: vec![(0, DAffine3::IDENTITY)],
        spheres: Vec::new(),
        is_shared: true,
    }
}

/// A thousand turned copies of a ball of 1,520 triangles.
pub fn instances() -> Scene {
    let mesh = ball(20, 40, |_, _| 1.0);
    let shape = mesh.shape();
    let mut next = numbers(3);
    let placed: Vec<_> = (0..1000)
        .map(|_| {
            let turn = DQuat::from_axis_angle(on_sphere(next(), next()), TAU * next());
            let at = dvec3(next(), next(), next()) * 2.0 - 1.0;
            let size = dvec3(0.04, 0.08, 0.06) * (0.5 + next());
            (0, DAffine3::from_scale_rotation_translation(size, turn, at))
        })
        .collect();
    let copies = placed.iter().map(|&(_, map)| place(shape.clone(), map));
    Scene {
        name: "instances",
        accel: Accel::build(copies.collect()),
        meshes: vec![mesh],
        placed,
        spheres: Vec::new(),
        is_shared: true,
    }
}

/// A ball of 39,600 triangles, all of whose vertices move by five edges.
pub fn moving() -> Scene {
    let mut mesh = ball(100, 200, |_, _| 1.0);
    let shift = dvec3(0.6, 0.0, 0.8) * 0.15;
    let moved = |p: &[f32; 3]| (DVec3::from(p.map(f64::from)) + shift).as_vec3().to_array();
    let last = mesh.keys[0].iter().map(moved).collect();
    mesh.keys.push(last);
    let frame = |time_s: f64, key: usize| KeyFrame {
        time_s,
        positions: mesh.keys[key].clone(),
        normals: None,
    };
    let frames = [frame(0.0, 0), frame(1.0, 1)];
    let shape = deforming::shape(&frames, None, mesh.indices.clone(), SHUTTER);
    let instance = place(shape.expect("a valid mesh"), DAffine3::IDENTITY);
    Scene {
        name: "moving",
        accel: Accel::build(vec![instance]),
        meshes: vec![mesh],
        placed: vec![(0, DAffine3::IDENTITY)],
        spheres: Vec::new(),
        is_shared: true,
    }
}

/// A thousand spheres.
pub fn spheres() -> Scene {
    let mut next = numbers(4);
    let spheres: Vec<_> = (0..1000)
        .map(|_| {
            let center = dvec3(next(), next(), next()) * 2.0 - 1.0;
            (center, 0.02 + 0.06 * next())
        })
        .collect();
    let instances = spheres.iter().map(|&(center, radius)| {
        let size = DVec3::splat(radius);
        let map = DAffine3::from_scale_rotation_translation(size, DQuat::IDENTITY, center);
        place(Shape::Sphere, map)
    });
    Scene {
        name: "spheres",
        accel: Accel::build(instances.collect()),
        meshes: Vec::new(),
        placed: Vec::new(),
        spheres,
        is_shared: true,
    }
}

/// Ten spherical lens surfaces in a row, as in a double Gauss of 100 mm (radius of curvature, place
/// on the axis and half aperture in millimeters).
pub fn lens() -> Scene {
    let surfaces = [
        (56.2, 0.0, 29.0),
        (152.3, 8.8, 28.0),
        (37.7, 9.3, 24.0),
        (1e4, 21.7, 23.0),
        (24.2, 25.5, 16.0),
        (-28.4, 54.7, 14.0),
        (1e4, 58.5, 17.5),
        (-37.9, 69.3, 19.0),
        (177.4, 70.2, 22.0),
        (-79.5, 77.0, 23.0),
    ];
    let instances = surfaces.map(|(radius, z, reach)| {
        let surface = LensSurface::new(Profile::sphere(radius), Aperture::circle(reach));
        let shape = LensShape::new(surface).expect("a possible surface");
        let map = DAffine3::from_scale_rotation_translation(
            DVec3::splat(1e-3),
            DQuat::IDENTITY,
            dvec3(0.0, 0.0, z * 1e-3),
        );
        place(Shape::Lens(Arc::new(shape)), map)
    });
    Scene {
        name: "lens",
        accel: Accel::build(instances.into()),
        meshes: Vec::new(),
        placed: Vec::new(),
        spheres: Vec::new(),
        is_shared: false,
    }
}
