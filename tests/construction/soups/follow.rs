//! How a tree is walked through, whatever its backend, and what must be seen on the way.

use std::ops::ControlFlow;

use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::settled::Settled;
use foldfront::selection::view::{Camera, View, theta_of_pixels};
use foldfront::testing::brute_force::{BruteForce, unfold_all};
use foldfront::testing::cut::Displayed;
use foldfront::testing::oracle::Oracle;
use foldfront::vertex_tree::{NullSink, Refine, VertexTree};
use foldfront::{CollapseLog, Mesh};
use glam::DVec3;

use super::check::{Fault, ensure, wrong};
use foldfront::testing::strict_mesh::StrictMesh;

/// The bits of the corners of triangles, in ascending order: each starts with its least corner.
pub type Facets = Vec<[[u32; 3]; 3]>;

/// The triangles of a mesh, but for those that name a vertex twice, which show nothing.
pub fn facets(mesh: &Mesh, triangles: impl IntoIterator<Item = [u32; 3]>) -> Facets {
    sorted(
        triangles
            .into_iter()
            .filter(|[a, b, c]| a != b && b != c && c != a)
            .map(|t| t.map(|v| mesh.positions[v as usize])),
    )
}

fn sorted(triangles: impl Iterator<Item = [[f32; 3]; 3]>) -> Facets {
    let mut all: Facets = triangles
        .map(|corners| {
            let [a, b, c] = corners.map(|p| p.map(f32::to_bits));
            [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap_or_default()
        })
        .collect();
    all.sort_unstable();
    all
}

fn displayed(mesh: &StrictMesh) -> Facets {
    sorted(mesh.triangles.values().map(|corners| corners.map(|v| mesh.vertices[&v].0)))
}

/// What a tree shows when everything is unfolded.
pub fn unfolded<T: VertexTree>(open: impl Fn() -> Result<T, Fault>) -> Result<Facets, Fault> {
    let (mut tree, mut mesh) = (Settled::new(open()?), StrictMesh::default());
    tree.start(&mut mesh).map_err(wrong)?;
    unfold_all(&mut tree, &mut mesh, |_, _| ControlFlow::Continue(())).map_err(wrong)?;
    Ok(displayed(&mesh))
}

/// What the cuts of a tree must be.
pub enum Truth {
    /// Those of a log, with what it shows.
    Log(Box<CollapseLog>, Oracle),
    /// Those of the backend's own nodes.
    Nodes(BruteForce),
}

impl Truth {
    pub fn log(log: CollapseLog) -> Result<Self, Fault> {
        let oracle = Oracle::new(&log).map_err(wrong)?;
        Ok(Self::Log(Box::new(log), oracle))
    }

    pub fn nodes<T: VertexTree>(open: impl Fn() -> Result<T, Fault>) -> Result<Self, Fault> {
        let mut tree = Settled::new(open()?);
        tree.start(&mut NullSink).map_err(wrong)?;
        BruteForce::new(&mut tree).map(Self::Nodes).map_err(wrong)
    }

    /// How an engine's cut differs, and what it should show, if that is known.
    fn of<T: Refine<StrictMesh>>(
        &mut self,
        engine: &Engine<T, StrictMesh>,
    ) -> (Option<String>, Option<Facets>) {
        match self {
            Self::Log(log, oracle) => {
                let difference = oracle.compare(engine).map(|difference| format!("{difference:?}"));
                let shown = Displayed::new(log, oracle.active()).mesh(&log.mesh);
                (difference, Some(facets(&shown, shown.triangles.iter().copied())))
            }
            Self::Nodes(brute_force) => {
                let count = brute_force.wrong(engine);
                ((count > 0).then(|| format!("{count} nodes")), None)
            }
        }
    }
}

/// Follows the views with every exact strategy. Cuts must be those of brute force, and what is displayed must be what they
/// show, bit for bit: the same for all strategies, and for a tree that has come to the last view straight.
pub fn follow<T: VertexTree>(
    open: impl Fn() -> Result<T, Fault>,
    truth: &mut Truth,
    views: &[View],
) -> Result<(), Fault> {
    let mut first: Option<Vec<Facets>> = None;
    let exact = Strategy::ALL.into_iter().filter(|strategy| strategy.is_exact());
    for strategy in exact {
        let shown = walk(&open, strategy, truth, views)?;
        match &first {
            Some(first) => {
                ensure(*first == shown, || format!("{} displays something else", strategy.name()))?;
            }
            None => first = Some(shown),
        }
    }
    let last = walk(&open, Strategy::TopDown, truth, &views[views.len().saturating_sub(1)..])?;
    let came = first.and_then(|mut shown| shown.pop());
    ensure(came.as_ref() == last.last(), || "what is displayed depends on the way".to_owned())
}

fn walk<T: VertexTree>(
    open: impl Fn() -> Result<T, Fault>,
    strategy: Strategy,
    truth: &mut Truth,
    views: &[View],
) -> Result<Vec<Facets>, Fault> {
    // Most of the steps are faster than declared, some slower: neither may make a difference.
    let rho = views.windows(2).map(|w| w[0].eye().distance(w[1].eye())).fold(0.0, f64::max) / 8.0;
    let settings = Settings { strategy, rho, ..Settings::default() };
    let tree = Settled::new(open()?);
    let mut engine = Engine::new(tree, StrictMesh::default(), settings).map_err(wrong)?;
    let mut all = Vec::with_capacity(views.len());
    for (n, view) in views.iter().enumerate() {
        let report = engine.advance(std::slice::from_ref(view)).map_err(wrong)?;
        let place = |what: String| format!("{}, view {n}: {what}", strategy.name());
        let put_off = report.misses + report.blocked + report.carried;
        ensure(put_off == 0, || place(format!("{put_off} changes put off")))?;
        let (difference, expected) = truth.of(&engine);
        ensure(difference.is_none(), || place(format!("cut: {}", difference.unwrap_or_default())))?;
        let shown = displayed(engine.sink());
        ensure(shown.len() as u64 == report.displayed, || place("another number of triangles".to_owned()))?;
        ensure(expected.is_none_or(|expected| expected == shown), || {
            place("what is displayed is not what the cut shows".to_owned())
        })?;
        all.push(shown);
    }
    Ok(all)
}

/// Views of a mesh from afar, from near, from within, and from afar again; `pixels` at 1080 lines are tolerated.
pub fn views(mesh: &Mesh, pixels: f64) -> Vec<View> {
    let (low, high) = mesh.bounding_box().unwrap_or_default();
    let [low, high] = [low, high].map(|p| DVec3::from(p.map(f64::from)));
    let middle = (low + high) / 2.0;
    // Of vertices at one place any size is as good as another.
    let size = if mesh.extent() > 0.0 { mesh.extent() } else { 1.0_f64.max(middle.length()) };
    let from = |direction: [f64; 3], distance: f64, target: DVec3| {
        let eye = middle + DVec3::from(direction) * (distance * size);
        let camera = Camera::look_at(eye, target, DVec3::Y, 1.0, 16.0 / 9.0).unwrap();
        View::new(&camera, theta_of_pixels(pixels, 1080)).unwrap()
    };
    vec![
        from([0.6, 0.0, 0.8], 60.0, middle),
        from([0.6, 0.1, 0.8], 1.0, middle),
        from([0.59, 0.1, 0.8], 0.98, middle),
        from([-0.1, 0.2, 0.1], 0.3, low),
        from([0.0, -0.01, 0.0], 1.0, high + DVec3::splat(0.1 * size)),
        from([-0.5, 0.5, -0.7], 7.0, middle),
    ]
}
