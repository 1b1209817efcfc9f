//! The rules of section 3.3.3, each by itself: counts, the free list, and the second chance.

use std::sync::Arc;
use std::time::Duration;

use page_store::Simulated;
use page_store::source::MemorySource;
use vertex_tree::{NONE, Prefetch};

use super::Pager;
use crate::lists::Class;
use crate::page::Layout;
use crate::tests::common;
use crate::{BuildOptions, InUse, Io, MetaNodeFile, Settings};

/// A pager over some hundred small pages with memory for all but one of the largest, so that it goes on counting.
fn pager(in_use: InUse, prefetch: Prefetch) -> Pager {
    let bytes =
        common::bytes(&common::random_log(60, 1, 11), &BuildOptions { levels: Some(3), page_bytes: 700 });
    let file = Arc::new(MetaNodeFile::open(Arc::new(MemorySource::new("tree", bytes))).unwrap());
    // On virtual time: there is no thread.
    let store = Simulated { latency: Duration::from_millis(1), bandwidth: None, depth: 1 };
    let io = Io::Simulated(store);
    let page_memory = file.header.page_bytes - file.holder_bytes();
    let mut pager =
        Pager::new(file, &Settings { page_memory, in_use, prefetch, io, ..Settings::default() }).unwrap();
    frame(&mut pager);
    assert!(pager.file.header.pages > 50);
    pager
}

/// Everything that has been asked for comes, and what that asks for. Says how many pages came.
fn frame(pager: &mut Pager) -> u64 {
    let mut reads = 0;
    loop {
        pager.end_frame();
        pager.settle();
        pager.begin_frame();
        pager.assert_well_formed();
        let came = pager.requests.take_stats().reads;
        reads += came;
        if came == 0 {
            return reads;
        }
    }
}

fn layout(pager: &Pager, page: u32) -> Layout {
    pager.places.holders[pager.find(page).unwrap() as usize].layout
}

fn class(pager: &Pager, page: u32) -> Option<Class> {
    pager.places.lists.class(pager.find(page)?)
}

/// The pages on the free list, in order.
fn free(pager: &Pager) -> Vec<u32> {
    pager.places.lists.iter(Class::Free).map(|holder| pager.places.holders[holder as usize].page).collect()
}

/// A page that is not kept, with pages below it and one above it that is not kept either.
fn inner_page(pager: &Pager) -> u32 {
    let mut words = Vec::new();
    let layout = |page: u32, words: &mut Vec<u32>| {
        words.resize(pager.file.page_words(page), 0);
        pager.file.read_page(page, words).unwrap()
    };
    (pager.kept..pager.file.header.pages)
        .find(|&page| {
            let Layout { parent, children, .. } = layout(page, &mut words);
            parent != NONE && parent >= pager.kept && children >= 2
        })
        .unwrap()
}

/// Whoever is in use asks for the pages above and below it and keeps them from the free list, once each.
#[test]
fn a_page_in_use_refers_to_those_around_it() {
    let mut pager = pager(InUse::Stays, Prefetch::Paper);
    let page = inner_page(&pager);
    assert_eq!(pager.find(page), None);
    pager.count_usage(page, 1);
    frame(&mut pager);
    let Layout { parent, first_child, children, .. } = layout(&pager, page);
    let around: Vec<u32> = (first_child..first_child + children).chain([parent]).collect();
    assert_eq!(class(&pager, page), Some(Class::InUse));
    for &other in &around {
        assert_eq!((pager.usage[other as usize], pager.references[other as usize]), (0, 1), "page {other}");
        assert_eq!(class(&pager, other), Some(Class::Prefetched), "page {other}");
    }
    // More nodes on the page are not more references.
    pager.count_usage(page, 1);
    pager.count_usage(first_child, 1);
    assert_eq!(pager.references[parent as usize], 1);
    assert_eq!(pager.references[page as usize], 1, "the child refers to the page above it");
    pager.count_usage(first_child, -1);
    pager.count_usage(page, -1);
    assert_eq!(pager.references[parent as usize], 1, "one node is left");
    pager.count_usage(page, -1);
    for &other in &around {
        assert_eq!(pager.references[other as usize], 0, "page {other}");
        assert_eq!(class(&pager, other), Some(Class::Free), "page {other}");
    }
    assert_eq!(class(&pager, page), Some(Class::Free));
    pager.assert_well_formed();
}

/// A page with no node of the front on it and none in use around it stays where it is, and is there when it is asked for
/// again.
#[test]
fn a_page_that_is_flushed_has_a_second_chance() {
    for in_use in [InUse::Stays, InUse::Yields] {
        let mut pager = pager(in_use, Prefetch::Paper);
        let page = inner_page(&pager);
        pager.count_usage(page, 1);
        assert!(frame(&mut pager) > 0);
        let holder = pager.find(page);
        pager.count_usage(page, -1);
        assert_eq!(frame(&mut pager), 0);
        assert_eq!((pager.find(page), class(&pager, page)), (holder, Some(Class::Free)), "{in_use:?}");
        pager.count_usage(page, 1);
        assert_eq!(frame(&mut pager), 0, "{in_use:?}: it is read again");
        assert_eq!(pager.find(page), holder);
        assert_ne!(class(&pager, page), Some(Class::Free), "{in_use:?}");
    }
}

/// The free list is first in, first out, and a page that has been in use again goes to its end.
#[test]
fn the_free_list_is_in_order_of_flushing() {
    let mut pager = pager(InUse::Stays, Prefetch::None);
    // Pages that refer to none below them; by an urgent request, as nothing is fetched ahead.
    let mut words = Vec::new();
    let mut leaves = (pager.kept..pager.file.header.pages).filter(|&page| {
        words.resize(pager.file.page_words(page), 0);
        pager.file.read_page(page, &mut words).unwrap().children == 0
    });
    let [a, b, c, d] = [(); 4].map(|()| leaves.next().unwrap());
    drop(leaves);
    for page in [a, b, c, d] {
        pager.count_usage(page, 1);
        pager.urge(page, super::Switch::Up);
    }
    frame(&mut pager);
    assert_eq!(free(&pager), [0; 0]);
    for page in [c, a, d, b] {
        pager.count_usage(page, -1);
    }
    assert_eq!(free(&pager), [c, a, d, b]);
    pager.count_usage(a, 1);
    assert_eq!(free(&pager), [c, d, b]);
    pager.count_usage(a, -1);
    assert_eq!(free(&pager), [c, d, b, a]);
    // Once all have had their frame, room is made in that order.
    frame(&mut pager);
    for gone in [c, d, b, a] {
        assert!(pager.find(gone).is_some());
        assert!(pager.give_free());
        assert_eq!(pager.find(gone), None, "page {gone} is the next to go");
        pager.assert_well_formed();
    }
}

/// The pages without any below them.
fn leaves(pager: &Pager) -> Vec<u32> {
    let mut words = Vec::new();
    let is_leaf = |&page: &u32| {
        words.resize(pager.file.page_words(page), 0);
        pager.file.read_page(page, &mut words).unwrap().children == 0
    };
    (0..pager.file.header.pages).filter(is_leaf).collect()
}

/// As printed: place holders are of one size, pages in use stay, and three that are not in use are kept from switching down.
#[test]
fn as_printed_three_place_holders_are_kept_from_switching_down() {
    let mut pager = pager(InUse::Printed, Prefetch::None);
    let largest = u64::from(pager.file.header.largest_words);
    let holders = pager.places.allowed / largest;
    assert!(holders < u64::from(pager.file.header.pages), "{holders}");
    let mut in_use = Vec::new();
    let mut refused = None;
    for page in leaves(&pager) {
        pager.urge(page, super::Switch::Down);
        frame(&mut pager);
        assert!(pager.places.taken.is_multiple_of(largest) && pager.places.taken <= pager.places.allowed);
        if pager.find(page).is_none() {
            refused = Some(page);
            break;
        }
        pager.count_usage(page, 1);
        in_use.push(page);
        frame(&mut pager);
    }
    let refused = refused.expect("not all of them fit");
    assert_eq!(in_use.len() as u64, holders - 2, "with two left that are not in use");
    assert!(in_use.iter().all(|&page| class(&pager, page) == Some(Class::InUse)));
    // Switching up is always allowed, and takes no page that is in use.
    pager.urge(refused, super::Switch::Up);
    frame(&mut pager);
    assert!(pager.find(refused).is_some());
    assert!(in_use.iter().all(|&page| pager.find(page).is_some()));
    // One that is let go of makes room for the next.
    pager.count_usage(in_use[0], -1);
    let other = leaves(&pager).into_iter().find(|&page| pager.find(page).is_none()).unwrap();
    pager.urge(other, super::Switch::Down);
    frame(&mut pager);
    assert!(pager.find(other).is_some());
}

/// As printed: where there is no free place holder, what is only likely to be needed is not fetched, now or later, until
/// something refers to it anew.
#[test]
fn as_printed_what_is_given_up_is_not_tried_again() {
    let mut pager = pager(InUse::Printed, Prefetch::Paper);
    let page = inner_page(&pager);
    pager.urge(page, super::Switch::Up);
    frame(&mut pager);
    // All the others are taken by what is in use.
    let Layout { first_child, children, .. } = layout(&pager, page);
    let below: Vec<u32> = (first_child..first_child + children).collect();
    let others: Vec<u32> = leaves(&pager).into_iter().filter(|leaf| !below.contains(leaf)).collect();
    for &other in &others {
        pager.urge(other, super::Switch::Up);
        frame(&mut pager);
        if pager.find(other).is_some() {
            pager.count_usage(other, 1);
        }
    }
    pager.count_usage(page, 1);
    frame(&mut pager);
    let missing: Vec<u32> = below.into_iter().filter(|&child| pager.find(child).is_none()).collect();
    assert!(!missing.is_empty(), "all of it is there");
    for &other in &others[..others.len() / 2] {
        if pager.usage[other as usize] > 0 {
            pager.count_usage(other, -1);
        }
    }
    assert_eq!(frame(&mut pager), 0, "something was tried again");
    assert!(missing.iter().all(|&child| pager.find(child).is_none()));
    pager.count_usage(page, -1);
    pager.count_usage(page, 1);
    frame(&mut pager);
    assert!(missing.iter().all(|&child| pager.find(child).is_some()), "they are referred to anew");
}
