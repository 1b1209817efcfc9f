//! Built-in scenes, made up of nothing but named seeds, bit-identical on every platform.
//!
//! They stand in for the three datasets of Zach & Karner (2003, Table 1), which were never published: the same kind
//! of data with the same triangle counts and extents. All are in metres with z up.
//!
//! | scene | stands for | triangles | diagonal |
//! | --- | --- | --- | --- |
//! | `scene:city` | Graz: block model of a historic centre | about 162,000 | about 2,970 |
//! | `scene:alps` | north-west Styria: digital elevation model | 524,288 | about 73,700 |
//! | `scene:laserscan` | urban elevation model from an airborne laser scanner | 720,000 | about 1,032 |
//!
//! `scene:NAME@4` has four times the samples a side over the same extent, that is about 16 times the triangles.

mod alps;
mod building;
pub(crate) mod city;
mod height_field;
pub(crate) mod laserscan;
mod layout;
pub(crate) mod noise;

use std::fmt;
use std::str::FromStr;

use collapse_log::Mesh;
use thiserror::Error;

pub use height_field::HeightField;

use construction::progress::Progress;

/// A name that is no scene.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum SceneError {
    /// The name does not start with `scene:`.
    #[error("{name:?} is not a scene: scenes are called scene:city, scene:alps or scene:laserscan")]
    NotAScene {
        /// The whole name.
        name: String,
    },
    /// There is no such scene.
    #[error("there is no scene {name:?}, only scene:city, scene:alps and scene:laserscan")]
    Unknown {
        /// The whole name.
        name: String,
    },
    /// What follows the `@` is not a whole number from 1 to [`Scene::MAX_SCALE`].
    #[error("{name:?}: the scale {scale:?} is not a whole number from 1 to {}", Scene::MAX_SCALE)]
    Scale {
        /// The whole name.
        name: String,
        /// What follows the `@`.
        scale: String,
    },
}

/// Which of the built-in scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SceneKind {
    /// A historic centre as a block model, every building a closed solid of its own.
    City,
    /// A height field of alpine relief.
    Alps,
    /// A height field of a town as an airborne laser scanner sees it.
    Laserscan,
}

impl SceneKind {
    /// Every scene, in the order of the paper's table.
    pub const ALL: [Self; 3] = [Self::City, Self::Alps, Self::Laserscan];

    /// The name after `scene:`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::City => "city",
            Self::Alps => "alps",
            Self::Laserscan => "laserscan",
        }
    }
}

/// A built-in scene at a number of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Scene {
    kind: SceneKind,
    scale: u32,
}

impl Scene {
    /// The largest scale: about 3.5 GB for the mesh of the largest scene, 230 million triangles.
    pub const MAX_SCALE: u32 = 18;

    /// The scene as it is without a scale.
    #[must_use]
    pub fn new(kind: SceneKind) -> Self {
        Self { kind, scale: 1 }
    }

    /// Reads `scene:NAME` or `scene:NAME@SCALE`.
    pub fn parse(name: &str) -> Result<Self, SceneError> {
        let whole = || name.to_owned();
        let rest = name.strip_prefix("scene:").ok_or_else(|| SceneError::NotAScene { name: whole() })?;
        let (short, scale) = rest.split_once('@').map_or((rest, None), |(short, scale)| (short, Some(scale)));
        let kind = SceneKind::ALL.into_iter().find(|kind| kind.name() == short);
        let kind = kind.ok_or_else(|| SceneError::Unknown { name: whole() })?;
        let scale = match scale {
            None => 1,
            Some(text) => text
                .parse()
                .ok()
                .filter(|scale| (1..=Self::MAX_SCALE).contains(scale))
                .ok_or_else(|| SceneError::Scale { name: whole(), scale: text.to_owned() })?,
        };
        Ok(Self { kind, scale })
    }

    /// Which scene it is.
    #[must_use]
    pub fn kind(&self) -> SceneKind {
        self.kind
    }

    /// How many times the samples a side.
    #[must_use]
    pub fn scale(&self) -> u32 {
        self.scale
    }

    /// Whether the scene is made of many separate objects, of which a view from afar shows only lumps.
    #[must_use]
    pub fn is_many_objects(&self) -> bool {
        self.kind == SceneKind::City
    }

    /// Makes the mesh.
    #[must_use]
    pub fn mesh(&self, progress: Progress) -> Mesh {
        let scale = self.scale as usize;
        match self.kind {
            SceneKind::City => city::mesh(scale, progress),
            SceneKind::Alps => alps::heights(scale, progress).mesh(),
            SceneKind::Laserscan => laserscan::heights(scale, progress).mesh(),
        }
    }

    /// The upper surface of the scene at scale 1, whatever this scene's scale: the scene itself where it is a height
    /// field, ground and roofs sampled every 3 m for the city. Detail that larger scales add moves the surface by
    /// decimetres in the towns, by up to about 15 m in the alps.
    #[must_use]
    pub fn surface(&self, progress: Progress) -> HeightField {
        match self.kind {
            SceneKind::City => city::surface(progress),
            SceneKind::Alps => alps::heights(1, progress),
            SceneKind::Laserscan => laserscan::heights(1, progress),
        }
    }
}

impl FromStr for Scene {
    type Err = SceneError;

    fn from_str(name: &str) -> Result<Self, SceneError> {
        Self::parse(name)
    }
}

impl fmt::Display for Scene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "scene:{}", self.kind.name())?;
        if self.scale == 1 { Ok(()) } else { write!(f, "@{}", self.scale) }
    }
}
