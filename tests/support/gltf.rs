//! Builds small GLB files.

use serde_json::{Value, json};

/// A GLB file in the making: bytes, and the JSON that describes them.
#[derive(Debug, Default)]
pub struct Builder {
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    images: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    nodes: Vec<Value>,
    samplers: Vec<Value>,
    channels: Vec<Value>,
    skins: Vec<Value>,
    /// Everything else of the root.
    pub root: serde_json::Map<String, Value>,
}

impl Builder {
    fn view(&mut self, bytes: &[u8]) -> usize {
        let offset = self.bin.len();
        self.bin.extend(bytes);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.views
            .push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }));
        self.views.len() - 1
    }

    /// An accessor of f32; its index.
    pub fn floats<const N: usize>(&mut self, values: &[[f32; N]], kind: &str) -> usize {
        let bytes: Vec<u8> = values
            .as_flattened()
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        let view = self.view(&bytes);
        self.accessors.push(json!({ "bufferView": view, "componentType": 5126, "count": values.len(), "type": kind }));
        self.accessors.len() - 1
    }

    /// A channel of the only animation: `values` at `times` (cubic: three per key).
    pub fn animate<const N: usize>(
        &mut self,
        (node, path): (usize, &str),
        interpolation: &str,
        times: &[f32],
        values: &[[f32; N]],
    ) {
        let times: Vec<[f32; 1]> = times.iter().map(|t| [*t]).collect();
        let input = self.floats(&times, "SCALAR");
        let kind = ["", "SCALAR", "", "VEC3", "VEC4"][N];
        let output = self.floats(values, kind);
        self.channels.push(
            json!({ "sampler": self.samplers.len(), "target": { "node": node, "path": path } }),
        );
        self.samplers
            .push(json!({ "input": input, "output": output, "interpolation": interpolation }));
    }

    /// A mesh of flat triangles without a node; `more` are further keys of its primitive. Its
    /// index.
    pub fn bare_mesh(&mut self, positions: &[[f32; 3]], indices: &[u16], more: &Value) -> usize {
        let position = self.floats(positions, "VEC3");
        let indices = self.indices(indices);
        let mut primitive = json!({ "attributes": { "POSITION": position }, "indices": indices });
        for (key, value) in more.as_object().into_iter().flatten() {
            match (key.as_str(), value.as_object()) {
                ("attributes", Some(attributes)) => {
                    for (name, accessor) in attributes {
                        primitive["attributes"][name] = accessor.clone();
                    }
                }
                _ => primitive[key] = value.clone(),
            }
        }
        self.meshes.push(json!({ "primitives": [primitive] }));
        self.meshes.len() - 1
    }

    /// A skin; its index.
    pub fn skin(&mut self, joints: &[usize], inverse_binds: &[[f32; 16]]) -> usize {
        let matrices = self.floats(inverse_binds, "MAT4");
        self.skins
            .push(json!({ "joints": joints, "inverseBindMatrices": matrices }));
        self.skins.len() - 1
    }

    /// An RGBA image as texture; its index.
    pub fn texture(&mut self, width: u32, height: u32, rgba: &[[u8; 4]], nearest: bool) -> usize {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(png::ColorType::Rgba);
        let mut writer = encoder.write_header().expect("header");
        writer.write_image_data(rgba.as_flattened()).expect("data");
        writer.finish().expect("end");
        let view = self.view(&bytes);
        self.images
            .push(json!({ "bufferView": view, "mimeType": "image/png" }));
        let filter = if nearest { 9728 } else { 9729 };
        let n = self.images.len() - 1;
        let list = |root: &mut serde_json::Map<String, Value>, key: &str, value: Value| {
            let entry = root.entry(key).or_insert_with(|| json!([]));
            entry.as_array_mut().expect("list").push(value);
        };
        list(
            &mut self.root,
            "samplers",
            json!({ "magFilter": filter, "wrapS": 33071, "wrapT": 33071 }),
        );
        list(
            &mut self.root,
            "textures",
            json!({ "source": n, "sampler": n }),
        );
        n
    }

    pub fn material(&mut self, material: Value) -> usize {
        self.materials.push(material);
        self.materials.len() - 1
    }

    pub fn node(&mut self, node: Value) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// A quad from `corner` along `u` and `v` (facing u x v): (0, 0) of its image at the upper
    /// left, corner + v.
    pub fn quad(&mut self, corner: [f32; 3], u: [f32; 3], v: [f32; 3], material: usize) {
        let at = |a: f32, b: f32| std::array::from_fn(|i| corner[i] + a * u[i] + b * v[i]);
        let positions: [[f32; 3]; 4] = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
        let uvs = [[0.0f32, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
        self.mesh(&positions, Some(&uvs), &[0, 1, 2, 0, 2, 3], material);
    }

    /// A closed cube.
    pub fn cube(&mut self, low: [f32; 3], high: [f32; 3], material: usize) {
        let positions: Vec<[f32; 3]> = (0..8usize)
            .map(|i| std::array::from_fn(|k| if i >> k & 1 == 0 { low[k] } else { high[k] }))
            .collect();
        let faces: [[u16; 4]; 6] = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let indices: Vec<u16> = faces
            .iter()
            .flat_map(|f| [f[0], f[1], f[2], f[0], f[2], f[3]])
            .collect();
        self.mesh(&positions, None, &indices, material);
    }

    fn mesh(
        &mut self,
        positions: &[[f32; 3]],
        uvs: Option<&[[f32; 2]]>,
        indices: &[u16],
        material: usize,
    ) {
        let mut attributes = json!({ "POSITION": self.floats(positions, "VEC3") });
        if let Some(uvs) = uvs {
            attributes["TEXCOORD_0"] = json!(self.floats(uvs, "VEC2"));
        }
        let indices = self.indices(indices);
        self.meshes.push(json!({ "primitives": [{ "attributes": attributes, "indices": indices, "material": material }] }));
        let mesh = self.meshes.len() - 1;
        self.node(json!({ "mesh": mesh }));
    }

    fn indices(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let view = self.view(&bytes);
        self.accessors.push(json!({ "bufferView": view, "componentType": 5123, "count": indices.len(), "type": "SCALAR" }));
        self.accessors.len() - 1
    }

    /// The JSON.
    pub fn json(&self) -> Value {
        let mut root = self.root.clone();
        let all: Vec<usize> = (0..self.nodes.len()).collect();
        for (key, value) in [
            ("asset", json!({ "version": "2.0" })),
            ("buffers", json!([{ "byteLength": self.bin.len() }])),
            ("bufferViews", json!(self.views)),
            ("accessors", json!(self.accessors)),
            ("images", json!(self.images)),
            ("meshes", json!(self.meshes)),
            ("materials", json!(self.materials)),
            ("nodes", json!(self.nodes)),
            ("scenes", json!([{ "nodes": all }])),
        ] {
            root.entry(key).or_insert(value);
        }
        if !self.channels.is_empty() {
            root.entry("animations").or_insert(
                json!([{ "name": "wave", "channels": self.channels, "samplers": self.samplers }]),
            );
        }
        if !self.skins.is_empty() {
            root.entry("skins").or_insert(json!(self.skins));
        }
        Value::Object(root)
    }

    /// The file, with another JSON than its own.
    pub fn glb_with(&self, json: &Value) -> Vec<u8> {
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let length = 12 + 8 + text.len() + 8 + self.bin.len();
        let word = |n: usize| (n as u32).to_le_bytes();
        let mut out = Vec::with_capacity(length);
        out.extend(b"glTF");
        out.extend(word(2));
        out.extend(word(length));
        out.extend(word(text.len()));
        out.extend(b"JSON");
        out.extend(text);
        out.extend(word(self.bin.len()));
        out.extend(b"BIN\0");
        out.extend(&self.bin);
        out
    }

    /// The file.
    pub fn glb(&self) -> Vec<u8> {
        self.glb_with(&self.json())
    }
}
